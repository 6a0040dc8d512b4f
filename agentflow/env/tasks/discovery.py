"""Task families: ours by module, those of other distributions by entry point.

A family from outside is a class in a distribution that declares it in its pyproject.toml:

    [project.entry-points."agentflow.families"]
    sweeping = "broom.sweeping:Sweeping"

Its levels are the files `levels/sweeping-1.yaml`, ... beside its module.
"""

from __future__ import annotations

import sys
from importlib.abc import Traversable
from importlib.resources import files

from agentflow.env.tasks.family import Family
from agentflow.errors import ConfigError
from agentflow.registry import Registry, subclass_of

LEVELS = "levels"

FAMILIES: Registry[type[Family]] = Registry(
    "task family",
    "agentflow.families",
    {
        name: f"agentflow.env.tasks.families.{name}:{name.capitalize()}"
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
    },
    subclass_of(Family, named_by="family"),
)


def level_files(name: str) -> list[Traversable]:
    """The YAML files of a family's levels, in order.

    Raises:
        UnknownNameError: There is no such family.
        ConfigError: It comes from outside and cannot be loaded, or has no folder for levels.
    """
    package = __package__ if name in FAMILIES.ours else _package_of(FAMILIES[name])
    if not package:
        where = FAMILIES.describe(name)
        raise ConfigError(f"{where} is a module outside any package; put it and {LEVELS}/ in one")
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
