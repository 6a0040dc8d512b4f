"""Registries of named parts: ours, and those of other distributions; loaded on first use.

Everything that can be added to agentflow has one registry; names, help and tests come from it:

    FAMILIES: Registry[type[Family]] = Registry(
        "task family",
        "agentflow.families",
        {"throwing": "agentflow.env.tasks.families.throwing:Throwing"},
        subclass_of(Family, named_by="family"),
    )
    FAMILIES["throwing"], list(FAMILIES), "sweeping" in FAMILIES

Another distribution adds to it in its pyproject.toml:

    [project.entry-points."agentflow.families"]
    sweeping = "broom.sweeping:Sweeping"
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache, cached_property
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from agentflow.errors import AgentflowError, ConfigError, PluginError, UnknownNameError

if TYPE_CHECKING:  # loading it takes as long as a whole `agentflow --help`
    from importlib.metadata import EntryPoint

T = TypeVar("T")
Check = Callable[[str, Any], str]
"""(name, part) -> why it cannot be used, such as "is not a function"; "" if it can."""
SOURCES = frozenset({".py", ".j2", ".yaml", ".yml", ".json", ".toml"})
"""Ends of the names of files that decide what a package does."""


class Registry(Mapping[str, T]):
    """Things of one kind by name: ours in the given order, then others alphabetically."""

    def __init__(
        self, kind: str, group: str | None, ours: Mapping[str, str | T], check: Check
    ) -> None:
        """Declare a registry; nothing is loaded or searched yet.

        Args:
            kind: Kind of part as messages call it, such as "physics engine".
            group: Entry-point group of other distributions; None if they cannot add to it.
            ours: Name -> "module:attribute", "module" for a whole module, or the part itself.
            check: Checks a part from another distribution.
        """
        self.kind, self._group, self._ours, self._check = kind, group, ours, check
        self._loaded: dict[str, T] = {}

    @property
    def ours(self) -> tuple[str, ...]:
        """Names of the parts that ship with agentflow."""
        return tuple(self._ours)

    def __iter__(self) -> Iterator[str]:
        """All names; loads nothing."""
        return iter((*self._ours, *self._others))

    def __len__(self) -> int:
        return len(self._ours) + len(self._others)

    def __contains__(self, name: object) -> bool:
        return name in self._ours or name in self._others

    def __getitem__(self, name: str) -> T:
        """The part of this name; raises UnknownNameError or, for a broken plugin, ConfigError."""
        if name not in self._loaded:
            if name not in self:
                raise UnknownNameError(self.kind, name, self)
            ours = name in self._ours
            self._loaded[name] = _import(self._ours[name]) if ours else self._load(name)
        return self._loaded[name]

    def describe(self, name: str) -> str:
        """The name and origin of a part from another distribution, for messages."""
        return self._describe(self._others[name])

    def identity(self, name: str) -> str:
        """What a part from elsewhere is: distribution, version, and a hash of its sources.

        "" for ours. The hash has 16 hex digits and covers the whole package of the part, so that an
        edited file counts where the version has stayed.
        """
        if name in self._ours or name not in self._others:
            return ""
        entry = self._others[name]
        dist = f"{entry.dist.name} {entry.dist.version} " if entry.dist else ""
        return f"{dist}source {_source_digest(entry.module.partition('.')[0])}"

    @contextmanager
    def blaming(self, name: str) -> Iterator[None]:
        """Run code of a part; what its own package raises becomes a PluginError that names it.

        Errors of agentflow, and bugs in parts of ours, propagate as they are.
        """
        try:
            yield
        except AgentflowError:
            raise
        except Exception as error:
            place = self._place_of(error, name)
            if not place:
                raise
            what = f"{type(error).__name__}: {error}"
            raise PluginError(f"{self.describe(name)} failed: {place} raised {what}") from error

    def _place_of(self, error: Exception, name: str) -> str:
        """File and line in the package of a part where an error is from; "" for one of ours."""
        if name in self._ours or name not in self._others:
            return ""
        package, place, step = self._others[name].module.partition(".")[0], "", error.__traceback__
        while step:  # the last one that is in either package
            owner = str(step.tb_frame.f_globals.get("__name__")).partition(".")[0]
            if owner in (package, "agentflow"):
                code = step.tb_frame.f_code
                place = f"{code.co_filename}, line {step.tb_lineno}" if owner == package else ""
            step = step.tb_next
        return place

    def _describe(self, entry: EntryPoint) -> str:
        origin = f" of the distribution {entry.dist.name!r}" if entry.dist else ""
        return f"the {self.kind} {entry.name!r} ({entry.value}){origin}"

    @cached_property
    def _others(self) -> dict[str, EntryPoint]:
        found: dict[str, EntryPoint] = {}
        if self._group is None:
            return found
        from importlib.metadata import entry_points

        for entry in sorted(entry_points(group=self._group), key=lambda entry: entry.name):
            if entry.name in self._ours or entry.name in found:
                problem = f"has the same name as another {self.kind}"
                raise ConfigError(f"{self._describe(entry)} {problem}")
            found[entry.name] = entry
        return found

    def _load(self, name: str) -> T:
        try:
            part: T = self._others[name].load()
            problem = self._check(name, part)
        except Exception as error:  # other people's code may raise anything
            problem = f"cannot be loaded: {type(error).__name__}: {error}"
            raise ConfigError(f"{self.describe(name)} {problem}") from error
        if problem:
            raise ConfigError(f"{self.describe(name)} {problem}")
        return part


@cache
def _source_digest(package: str) -> str:
    """Hash of the sources of a top-level package or module, as they are on disk."""
    import hashlib
    from importlib.util import find_spec

    spec = find_spec(package)
    digest = hashlib.sha256()
    for root in map(Path, (spec and spec.submodule_search_locations) or ()):
        for file in sorted(root.rglob("*")):
            if file.suffix in SOURCES and file.is_file():
                digest.update(f"{file.relative_to(root).as_posix()}\0".encode())
                digest.update(file.read_bytes() + b"\0")
    if spec and not spec.submodule_search_locations and spec.origin:
        digest.update(Path(spec.origin).read_bytes())
    return digest.hexdigest()[:16]


def is_callable(_: str, part: Any) -> str:
    """A check for functions and other callables."""
    return "" if callable(part) else "is not a function"


def instance_of(base: type | str) -> Check:
    """A check for instances of a class, which is given itself or as "module:Class"."""

    def check(_: str, part: Any) -> str:
        kind: type = _import(base)
        name = f"{kind.__module__}.{kind.__qualname__}"
        return "" if isinstance(part, kind) else f"is not an instance of {name}"

    return check


def subclass_of(base: type | str, named_by: str) -> Check:
    """A check for subclasses of a class, which is given itself or as "module:Class".

    Their attribute `named_by` must be the name that they are registered by.
    """

    def check(name: str, part: Any) -> str:
        kind: type = _import(base)
        if not (isinstance(part, type) and issubclass(part, kind)):
            return f"is not a subclass of {kind.__module__}.{kind.__qualname__}"
        own_name = getattr(part, named_by, None)
        return "" if own_name == name else f"has {named_by} = {own_name!r}"

    return check


def package_with(file: str) -> Check:
    """A check for packages that contain a file of this name."""

    def check(_: str, part: Any) -> str:
        from importlib.resources import files

        has_file = hasattr(part, "__path__") and files(part).joinpath(file).is_file()
        return "" if has_file else f"is not a package with a file {file}"

    return check


def _import(part: Any) -> Any:
    """Import "module:attribute" or "module"; return anything else unchanged."""
    if not isinstance(part, str):
        return part
    module, _, attribute = part.partition(":")
    return getattr(import_module(module), attribute) if attribute else import_module(module)
