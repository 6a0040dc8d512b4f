"""Registries: ours by name, those of other distributions by entry point, loaded on first use.

Whatever can be added to agentflow has one registry, from which names, help and tests are made:

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
from functools import cached_property
from importlib import import_module
from typing import TYPE_CHECKING, Any, TypeVar

from agentflow.errors import ConfigError, UnknownNameError

if TYPE_CHECKING:  # loading it takes as long as a whole `agentflow --help`
    from importlib.metadata import EntryPoint

T = TypeVar("T")
Check = Callable[[str, Any], str]
"""(name, loaded object) -> why it cannot be used, as "is not ..."; "" if it can."""


class Registry(Mapping[str, T]):
    """The things of one kind by name: ours in the given order, then others alphabetically."""

    def __init__(self, kind: str, group: str, ours: Mapping[str, str | T], check: Check) -> None:
        """Declare a registry; nothing is loaded and no distribution is searched yet.

        Args:
            kind: what its things are called in messages, e.g. "physics engine".
            group: entry-point group of other distributions.
            ours: name -> "module:attribute", "module" for a whole module, or the thing itself.
            check: what is wrong with a thing from another distribution.
        """
        self.kind, self._group, self._ours, self._check = kind, group, ours, check
        self._loaded: dict[str, T] = {}

    @property
    def ours(self) -> tuple[str, ...]:
        """Names of the things that ship with agentflow."""
        return tuple(self._ours)

    def __iter__(self) -> Iterator[str]:
        """All names; loads none of the things."""
        return iter((*self._ours, *self._others))

    def __len__(self) -> int:
        return len(self._ours) + len(self._others)

    def __contains__(self, name: object) -> bool:
        return name in self._ours or name in self._others

    def __getitem__(self, name: str) -> T:
        """The thing of this name.

        Raises:
            UnknownNameError: There is none.
            ConfigError: It comes from another distribution and cannot be loaded or used, or two
                things have one name; the message names entry point and distribution.
        """
        if name not in self._loaded:
            if name not in self:
                raise UnknownNameError(self.kind, name, self)
            ours = name in self._ours
            self._loaded[name] = _import(self._ours[name]) if ours else self._load(name)
        return self._loaded[name]

    def describe(self, name: str) -> str:
        """A name from another distribution and its origin, for messages."""
        return self._describe(self._others[name])

    def _describe(self, entry: EntryPoint) -> str:
        origin = f" of the distribution {entry.dist.name!r}" if entry.dist else ""
        return f"the {self.kind} {entry.name!r} ({entry.value}){origin}"

    @cached_property
    def _others(self) -> dict[str, EntryPoint]:
        from importlib.metadata import entry_points

        found: dict[str, EntryPoint] = {}
        for entry in sorted(entry_points(group=self._group), key=lambda entry: entry.name):
            if entry.name in self._ours or entry.name in found:
                problem = f"has a name that another {self.kind} already has"
                raise ConfigError(f"{self._describe(entry)} {problem}")
            found[entry.name] = entry
        return found

    def _load(self, name: str) -> T:
        try:
            thing: T = self._others[name].load()
            problem = self._check(name, thing)
        except Exception as error:  # other people's code may raise anything
            problem = f"cannot be loaded: {type(error).__name__}: {error}"
            raise ConfigError(f"{self.describe(name)} {problem}") from error
        if problem:
            raise ConfigError(f"{self.describe(name)} {problem}")
        return thing


def is_callable(_: str, thing: Any) -> str:
    """A check that refuses everything but functions and their like."""
    return "" if callable(thing) else "is not a function"


def instance_of(base: type | str) -> Check:
    """A check that refuses all but instances of a class, given itself or as "module:Class"."""

    def check(_: str, thing: Any) -> str:
        kind: type = _import(base)
        named = f"{kind.__module__}.{kind.__qualname__}"
        return "" if isinstance(thing, kind) else f"is not an instance of {named}"

    return check


def subclass_of(base: type | str, named_by: str) -> Check:
    """A check that refuses all but subclasses of a class, given itself or as "module:Class".

    Their attribute `named_by` must hold the name under which they are registered.
    """

    def check(name: str, thing: Any) -> str:
        kind: type = _import(base)
        if not (isinstance(thing, type) and issubclass(thing, kind)):
            return f"is not a subclass of {kind.__module__}.{kind.__qualname__}"
        own_name = getattr(thing, named_by, None)
        return "" if own_name == name else f"calls itself {own_name!r}"

    return check


def package_with(file: str) -> Check:
    """A check that refuses everything but packages that contain a file of this name."""

    def check(_: str, thing: Any) -> str:
        from importlib.resources import files

        is_one = hasattr(thing, "__path__") and files(thing).joinpath(file).is_file()
        return "" if is_one else f"is not a package with a file {file}"

    return check


def _import(thing: Any) -> Any:
    """What a text "module:attribute" or "module" names; anything else as it is."""
    if not isinstance(thing, str):
        return thing
    module, _, attribute = thing.partition(":")
    return getattr(import_module(module), attribute) if attribute else import_module(module)
