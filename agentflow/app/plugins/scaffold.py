"""Writes a package with one part of one's own, which can be installed, and with its test."""

from __future__ import annotations

import keyword
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib import resources
from importlib.util import find_spec
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal

import jinja2

from agentflow.agents.registry import ROLES
from agentflow.env.tasks.registry import FAMILIES
from agentflow.errors import UsageError
from agentflow.files.atomic import os_errors
from agentflow.metrics.cells import METRICS
from agentflow.prompts.registry import PROMPT_SETS
from agentflow.prompts.render import PromptSet
from agentflow.registry import Registry
from agentflow.search.registry import STRATEGIES

if TYPE_CHECKING:  # Python 3.14 has it in importlib.resources.abc only, 3.10 here only
    from importlib.abc import Traversable

Kind = Literal["family", "strategy", "role", "metric", "prompts"]
TEST, LEVEL = "test.py", "level.yaml"
"""Templates whose files are named after the package."""


@dataclass(frozen=True)
class _About:
    """What a new package of a kind has."""

    registry: Registry[Any]
    entries: tuple[tuple[str, str], ...]
    """Group of entry points, without `agentflow.`, and what it names in the package."""
    use: str
    """A command that uses the part; NAME is its name."""


KINDS: Mapping[Kind, _About] = MappingProxyType(
    {
        "family": _About(
            FAMILIES,
            (("families", ".task:CLASS"),),
            "agentflow design --task NAME",
        ),
        "strategy": _About(
            STRATEGIES,
            (("strategies", ".strategy:NAME"),),
            "agentflow design --set search.strategy=NAME",
        ),
        "role": _About(
            ROLES,
            (("roles", ".role:CLASS"), ("workflows", ".role:WORKFLOW")),
            "agentflow design --workflow NAME",
        ),
        "metric": _About(
            METRICS,
            (("metrics", ".metric:METRIC"),),
            "table: {metrics: [NAME]}  # in a sweep",
        ),
        "prompts": _About(PROMPT_SETS, (("prompts", ""),), "agentflow design --set prompts=NAME"),
    }
)


@dataclass(frozen=True)
class NewPlugin:
    """A package that was written."""

    path: Path
    files: tuple[str, ...]
    """Paths in the package's folder."""
    use: str
    """How to use the part once it is installed."""


def new_plugin(path: Path, kind: Kind) -> NewPlugin:
    """Write a package with one part, which is named after the folder.

    Raises:
        UsageError: The folder is not empty or cannot be written, or its name is not free.
    """
    package = re.sub(r"\W", "_", path.resolve().name.lower())
    class_name = "".join(word.capitalize() for word in package.split("_"))
    about = KINDS[kind]
    _require_free(path, package, about.registry)
    entries = [
        (group, package + target.replace("NAME", package).replace("CLASS", class_name))
        for group, target in about.entries
    ]
    variables = {
        "package": package,
        "class_name": class_name,
        "kind": about.registry.kind,
        "entries": entries,
        "usual": PromptSet().files["designer/system.j2"].rstrip("\n"),
    }
    files = dict(_render(kind, package, variables))
    with os_errors(f"cannot write to {path}"):
        for name, text in files.items():
            (path / name).parent.mkdir(parents=True, exist_ok=True)
            (path / name).write_text(text, encoding="utf-8")
    return NewPlugin(path, tuple(sorted(files)), about.use.replace("NAME", package))


def _require_free(path: Path, package: str, registry: Registry[Any]) -> None:
    if path.exists() and (not path.is_dir() or any(path.iterdir())):
        raise UsageError(f"{path} is not empty: name a new folder")
    if not package.isidentifier() or keyword.iskeyword(package):
        raise UsageError(f"{path.name!r} cannot name a package: use letters, digits and _")
    if find_spec(package) is not None or package in registry:
        raise UsageError(
            f"there is already a package or {registry.kind} {package!r}: choose another name"
        )


def _render(kind: Kind, package: str, variables: Mapping[str, object]) -> Iterator[tuple[str, str]]:
    """Path in the new folder, and content, of each file."""
    environment = jinja2.Environment(
        variable_start_string="<<",
        variable_end_string=">>",
        block_start_string="<%",
        block_end_string="%>",
        comment_start_string="<#",
        comment_end_string="#>",
        undefined=jinja2.StrictUndefined,
        autoescape=False,
        trim_blocks=True,
        keep_trailing_newline=True,
    )
    home = resources.files("agentflow.app.plugins").joinpath("templates")
    own = {f"{package}/{name}": text for name, text in _walk(home.joinpath(kind), "")}
    shared = ("pyproject.toml", "__init__.py")
    common = {name: home.joinpath(f"{name}.j2").read_text("utf-8") for name in shared}
    places = {
        f"{package}/{TEST}": f"tests/test_{package}.py",
        f"{package}/levels/{LEVEL}": f"{package}/levels/{package}-1.yaml",
        "__init__.py": f"{package}/__init__.py",
    }
    for name, text in {**common, **own}.items():
        yield places.get(name, name), environment.from_string(text).render(variables)


def _walk(folder: Traversable, above: str) -> Iterator[tuple[str, str]]:
    """Path, without `.j2`, and text of each template in a folder."""
    for item in folder.iterdir():
        if item.is_dir():
            yield from _walk(item, f"{above}{item.name}/")
        else:
            yield f"{above}{item.name}".removesuffix(".j2"), item.read_text("utf-8")
