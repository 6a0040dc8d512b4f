"""Owns which families exist: ours by module, others' by entry point, each loaded on first use.

A family from outside is a class in a distribution that declares it in its pyproject.toml:

    [project.entry-points."agentflow.families"]
    sweeping = "broom.sweeping:Sweeping"

Its levels are the files `levels/sweeping-1.yaml`, ... beside its module.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from functools import cache
from importlib.abc import Traversable
from importlib.metadata import EntryPoint, entry_points
from importlib.resources import files
from types import MappingProxyType

from agentflow.env.tasks.family import Family
from agentflow.errors import ConfigError, UnknownNameError

GROUP = "agentflow.families"
LEVELS = "levels"

OURS: Mapping[str, EntryPoint] = MappingProxyType(
    {
        name: EntryPoint(name, f"agentflow.env.tasks.families.{name}:{name.capitalize()}", GROUP)
        for name in (
            "delivery",
            "flying",
            "gearing",
            "jumping",
            "lifting",
            "movement",
            "picking",
            "throwing",
        )
    }
)


def family_names() -> tuple[str, ...]:
    """All families: ours in alphabetical order, then others'."""
    return (*OURS, *_others())


def family(name: str) -> type[Family]:
    """The family of this name.

    Raises:
        UnknownNameError: There is none.
        ConfigError: It comes from outside and cannot be loaded; names it and its distribution.
    """
    return _load(_entry(name))


def level_files(name: str) -> list[Traversable]:
    """The files of a family's levels, in order.

    Raises:
        UnknownNameError, ConfigError: As `family` does.
    """
    entry = _entry(name)
    package = __package__ if name in OURS else _package_of(_load(entry))
    if not package:
        raise ConfigError(f"{_named(entry)} is in no package that could hold its levels")
    folder = files(package) / LEVELS
    found = list(folder.iterdir()) if folder.is_dir() else []
    wanted = (item for item in found if _number(item.name, name) is not None)
    return sorted(wanted, key=lambda item: _number(item.name, name) or 0)


def _package_of(kind: type[Family]) -> str | None:
    """The package that a family's module lies in, or is; "" for a module on its own."""
    return sys.modules[kind.__module__].__package__


def _number(file: str, name: str) -> int | None:
    """The number of a family's level by the name of its file; None for other files."""
    head, _, number = file.removesuffix(".yaml").rpartition("-")
    return int(number) if file.endswith(".yaml") and head == name and number.isdecimal() else None


def _entry(name: str) -> EntryPoint:
    found = OURS.get(name) or _others().get(name)
    if found is None:
        raise UnknownNameError("family", name, family_names())
    return found


@cache
def _others() -> Mapping[str, EntryPoint]:
    found: dict[str, EntryPoint] = {}
    for entry in sorted(entry_points(group=GROUP), key=lambda entry: entry.name):
        if entry.name in OURS or entry.name in found:
            raise ConfigError(f"{_named(entry)} has a name that another family has already")
        found[entry.name] = entry
    return found


@cache
def _load(entry: EntryPoint) -> type[Family]:
    try:
        kind = entry.load()
    except Exception as error:  # other people's code may raise anything
        raise ConfigError(
            f"{_named(entry)} cannot be loaded: {type(error).__name__}: {error}"
        ) from error
    if not (isinstance(kind, type) and issubclass(kind, Family)):
        raise ConfigError(f"{_named(entry)} is no subclass of {Family.__module__}.Family")
    if getattr(kind, "family", None) != entry.name:
        raise ConfigError(f"{_named(entry)} calls itself {getattr(kind, 'family', None)!r}")
    return kind


def _named(entry: EntryPoint) -> str:
    origin = f" of the distribution {entry.dist.name!r}" if entry.dist else ""
    return f"the task family {entry.name!r} ({entry.value}){origin}"
