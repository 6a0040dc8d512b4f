"""Task families: ours by module, those of other distributions by entry point.

A family from outside is a class in a distribution that declares it in its pyproject.toml:

    [project.entry-points."agentflow.families"]
    sweeping = "broom.sweeping:Sweeping"

Its levels are the files `levels/sweeping-1.yaml`, ... beside its module.
"""

from __future__ import annotations

import re
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


def level_files(name: str) -> dict[int, Traversable]:
    """The YAML files of a family's levels by number, in order.

    Raises:
        UnknownNameError: There is no such family.
        ConfigError: It comes from outside and cannot be loaded, or has no folder for levels.
    """
    package: str | None = __package__
    if name not in FAMILIES.ours:
        package = sys.modules[FAMILIES[name].__module__].__package__
    if not package:
        where = FAMILIES.describe(name)
        raise ConfigError(f"{where} is a module outside any package; put it and {LEVELS}/ in one")
    folder = files(package) / LEVELS
    found = {}
    for item in folder.iterdir() if folder.is_dir() else ():
        if match := re.fullmatch(rf"{re.escape(name)}-(\d+)\.yaml", item.name):
            found[int(match[1])] = item
    return dict(sorted(found.items()))
