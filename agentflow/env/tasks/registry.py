"""Owns which tasks exist: the families, their levels as data, and how a name becomes a task.

A new family is one module and an entry in FAMILIES; a new level is one file in levels/.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import yaml
from pydantic import BaseModel, ConfigDict, ValidationError

from agentflow.env.tasks.base import Task
from agentflow.env.tasks.family import Family
from agentflow.env.tasks.knobs import (
    Knob,
    knobs_of,
    merged,
    nested,
    read_knobs,
)
from agentflow.env.tasks.movement import Movement
from agentflow.env.tasks.throwing import Throwing
from agentflow.errors import ConfigError, UnknownNameError

FAMILIES: Mapping[str, type[Family]] = {kind.family: kind for kind in (Movement, Throwing)}


class LevelFile(BaseModel):
    """One level as written in YAML."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    family: str
    title: str
    good: float
    """What a good score is, in the family's unit."""
    note: str = ""
    """Why numbers differ from the published scene, where they do."""
    parameters: dict[str, Any] = {}
    """Knobs that differ from the family's defaults."""


@dataclass(frozen=True)
class Level:
    """A named set of parameters."""

    name: str
    """As users write it: "throwing", "throwing/3", or the path of an own file."""
    number: int
    """1 to 5; 0 for an own file."""
    file: LevelFile


@cache
def _shipped() -> dict[str, Level]:
    """All levels of the package by name, families in alphabetical order, easy ones first."""
    levels = {}
    folder = files("agentflow.env.tasks") / "levels"
    for entry in sorted(folder.iterdir(), key=lambda item: item.name):
        family, _, number = entry.name.removesuffix(".yaml").rpartition("-")
        name = family if number == "1" else f"{family}/{number}"
        levels[name] = Level(name, int(number), _read(entry.read_text(encoding="utf-8"), name))
    return levels


def _read(text: str, source: str) -> LevelFile:
    try:
        return LevelFile.model_validate(yaml.safe_load(text))
    except yaml.YAMLError as error:
        raise ConfigError(f"{source} is not YAML: {str(error).splitlines()[0]}") from None
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        key = ".".join(str(part) for part in first["loc"]) or "the file"
        raise ConfigError(f"{source}: {key}: {first['msg']}") from None


def task_names() -> tuple[str, ...]:
    """Every shipped level; a family's first level bears the family's name alone."""
    return tuple(_shipped())


def get_level(name: str) -> Level:
    """The level of this name: "throwing", "throwing/1" or the path of a YAML file.

    Raises:
        UnknownNameError: no such level.
        ConfigError: the file at the path is not a level.
    """
    if name.endswith((".yaml", ".yml")):
        try:
            text = Path(name).read_text(encoding="utf-8")
        except OSError as error:
            raise ConfigError(f"cannot read the level {name}: {error.strerror}") from None
        return Level(name, 0, _read(text, name))
    level = _shipped().get(name.removesuffix("/1"))
    if level is None:
        raise UnknownNameError("task", name, task_names())
    return level


def get_task(name: str, overrides: Mapping[str, object] | None = None) -> Task:
    """A task that is ready to be simulated.

    Args:
        name: as for `get_level`.
        overrides: dotted knobs laid over the level's, e.g. {"wind.speed": 8}; numbers may be text.

    Raises:
        UnknownNameError: no such level or family.
        ConfigError: an unknown or out-of-range knob; the message names the range.
    """
    level = get_level(name)
    kind = FAMILIES.get(level.file.family)
    if kind is None:
        raise UnknownNameError("family", level.file.family, FAMILIES)
    values = merged(level.file.parameters, nested(overrides or {}))
    knobs = read_knobs(kind.knobs, values, level.name)
    return kind(level.name, level.number, knobs, knobs.window, kind.schedule_of(knobs))


def knob_table(name: str) -> tuple[tuple[Knob, Any], ...]:
    """Every knob of a level with the level's value, in the family's order."""
    task = get_task(name)
    return tuple(
        (item, _value(task.parameters, item.name)) for item in knobs_of(type(task.parameters))
    )


def _value(parameters: BaseModel, dotted: str) -> Any:
    value: Any = parameters
    for part in dotted.split("."):
        value = getattr(value, part)
    return value
