"""Task families, their levels by name, and tasks made from them.

A family from another distribution is a class that its pyproject.toml declares:

    [project.entry-points."agentflow.families"]
    sweeping = "broom.sweeping:Sweeping"

Its levels are the files `levels/sweeping-1.yaml`, ... beside its module.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import files
from operator import attrgetter
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from agentflow.env.physics.engine import AUTO
from agentflow.env.physics.engines import choose_engine
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.family import Family
from agentflow.env.tasks.knobs import Knob, knobs_of, read_knobs
from agentflow.errors import ConfigError, UnknownNameError, UsageError
from agentflow.files.faults import tell_fault
from agentflow.files.yaml import deep_merge, nest_keys, parse_yaml, read_yaml_file
from agentflow.machine.blocks.library import library
from agentflow.machine.tree import ROOT
from agentflow.registry import Registry, subclass_of

LEVELS = "levels"

FAMILIES: Registry[type[Family]] = Registry(
    "task family",
    "agentflow.families",
    {
        name: f"agentflow.env.tasks.families.{name}:{name.capitalize()}"
        for name in (
            "bridge",
            "delivery",
            "flying",
            "gearing",
            "jumping",
            "lifting",
            "movement",
            "picking",
            "rocket",
            "throwing",
            "transport",
        )
    },
    subclass_of(Family, named_by="family"),
)


class LevelFile(BaseModel):
    """Contents of a level's YAML file."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    family: str
    title: str
    good: float = Field(gt=0, allow_inf_nan=False)
    """A good score, in the family's unit."""
    note: str = ""
    """What makes the level hard, or why its numbers were chosen."""
    controls: Literal["schedule", "designed", "sensed"] = "schedule"
    """As the knob of this name, which replaces it."""
    trials: int = Field(1, ge=1, le=10)
    """Rollouts of a design with controls of its own, which may revise them in between."""
    parameters: dict[str, Any] = {}
    """Knobs that differ from the family's defaults."""

    @model_validator(mode="after")
    def _trials_revise_controls(self) -> LevelFile:
        if self.trials > 1 and self.controls == "schedule":
            raise ValueError("trials revise controls: add controls: designed, or remove trials")
        return self


@dataclass(frozen=True)
class Level:
    """A named set of parameters."""

    name: str
    """As users write it: "throwing", "throwing/3", or the path of a YAML file."""
    number: int
    """From 1 on; 0 for a level read from a path."""
    file: LevelFile

    @property
    def record(self) -> dict[str, Any]:
        """The level as JSON data, for `recorded_level`."""
        return {"name": self.name, "number": self.number, **self.file.model_dump(mode="json")}


@cache
def _levels(name: str) -> dict[str, Level]:
    """The levels of a family by name, easiest first.

    Raises:
        UnknownNameError: There is no such family.
        ConfigError: It comes from outside and cannot be loaded, or has no folder for levels.
    """
    package: str | None = __package__
    if name not in FAMILIES.ours:
        package = sys.modules[FAMILIES[name].__module__].__package__
    if not package:
        where = FAMILIES.describe(name)
        raise ConfigError(
            f"{where} is a module outside any package; move it and {LEVELS}/ into a package"
        )
    folder = files(package) / LEVELS
    found = {}
    for file in folder.iterdir() if folder.is_dir() else ():
        if match := re.fullmatch(rf"{re.escape(name)}-(\d+)\.yaml", file.name):
            number = int(match[1])
            level = name if number == 1 else f"{name}/{number}"
            content = _validate(parse_yaml(file.read_text("utf-8"), level), level)
            found[number] = Level(level, number, content)
    return {level.name: level for _, level in sorted(found.items())}


def known_unit(task: str) -> str:
    """Unit of the scores of a task; "" if it cannot be made here."""
    with suppress(UsageError):
        return get_task(task).unit
    return ""


def known_title(level: str) -> str:
    """What a level is called in words; "" if it is not known here."""
    with suppress(UsageError):
        return get_level(level).file.title
    return ""


def recorded_level(record: Mapping[str, Any], source: str) -> Level:
    """A level from its record; `source` is named if it is damaged, as ConfigError."""
    content = dict(record)
    name, number = content.pop("name", None), content.pop("number", None)
    if type(name) is not str or type(number) is not int:
        raise ConfigError(f"{source} must have a name and a number")
    return Level(name, number, _validate(content, source))


def _validate(document: object, source: str) -> LevelFile:
    if not isinstance(document, dict):
        raise ConfigError(f"{source} must be a mapping with family, title, good and parameters")
    try:
        return LevelFile.model_validate(document)
    except ValidationError as error:
        raise ConfigError(f"{source}: {tell_fault(error, 'the file', LevelFile)}") from None


def task_names() -> tuple[str, ...]:
    """Every level of every family; a family's first level has the family's name."""
    return tuple(level for name in FAMILIES for level in _levels(name))


def get_level(name: str) -> Level:
    """Find a level.

    Args:
        name: "throwing", "throwing/1" or the path of a YAML file.

    Raises:
        UnknownNameError: There is no such level.
        ConfigError: The file cannot be read or is not a level.
    """
    if name.endswith((".yaml", ".yml")):
        return Level(name, 0, _validate(read_yaml_file(name, "the level "), name))
    kind = name.partition("/")[0]
    level = _levels(kind).get(name.removesuffix("/1")) if kind in FAMILIES else None
    if level is None:
        raise UnknownNameError("task", name, task_names())
    return level


def get_task(name: str, overrides: Mapping[str, object] | None = None, engine: str = AUTO) -> Task:
    """Create a task.

    Args:
        name: As for `get_level`.
        overrides: Dotted knobs that replace the level's, e.g. {"wind.speed": 8}; numbers may be
            strings.
        engine: Name of the physics engine that is to simulate it.

    Raises:
        UnknownNameError: There is no such level, family or engine.
        ConfigError: A knob is unknown or out of range (the message names the range), or the engine
            is not installed.
    """
    if engine != AUTO:
        choose_engine(engine)
    if overrides or name.endswith((".yaml", ".yml")):
        return make_task(get_level(name), overrides, engine)
    return _shipped_task(name, engine)


@cache
def _shipped_task(name: str, engine: str) -> Task:
    return make_task(get_level(name), None, engine)


def make_task(
    level: Level, overrides: Mapping[str, object] | None = None, engine: str = AUTO
) -> Task:
    """Create the task of a level; see `get_task`. The engine need not be installed."""
    kind = FAMILIES[level.file.family]
    given = {"controls": level.file.controls, **level.file.parameters}
    values = deep_merge(given, nest_keys(overrides or {}))
    knobs = read_knobs(kind.knobs, values, level.name)
    designed = knobs.controls != "schedule"
    trials = level.file.trials if designed else 1
    schedule = replace(knobs.control_schedule, designed=designed, trials=trials)
    task = kind(level.name, level.number, knobs, knobs.window, schedule, engine)
    if knobs.blocks.without:
        _check_withheld(task, knobs.blocks.without)
    return task


def _check_withheld(task: Task, withheld: Collection[int]) -> None:
    """Raise ConfigError if a type that every machine needs is withheld, or a type is unknown."""
    for kind in withheld:
        if kind not in library():
            raise ConfigError(f"blocks.without: {kind} is not a block type; see: agentflow blocks")
        if kind in task.brief.required or kind == ROOT.type:
            raise ConfigError(
                f"blocks.without: every machine for {task.name} needs type {kind}; remove it from "
                "the list"
            )


def knob_names(name: str, knobs: Mapping[str, object]) -> dict[str, object]:
    """Knobs of a level, given with underscores in place of dots, by their own names."""
    known = {knob.name.replace(".", "_"): knob.name for knob, _ in knob_table(get_task(name))}
    return {known.get(knob, knob): value for knob, value in knobs.items()}


def knob_table(task: Task) -> tuple[tuple[Knob, Any], ...]:
    """All knobs of a task with their values, in the family's order."""
    knobs = task.parameters
    return tuple((item, attrgetter(item.name)(knobs)) for item in knobs_of(type(knobs)))
