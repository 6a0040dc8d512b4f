"""Tasks: list the levels, or describe one in full."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from agentflow.config.run import split_setting
from agentflow.env.physics.engine import AUTO
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.records import record_json
from agentflow.env.tasks.registry import get_level, get_task, knob_table, known_unit, task_names
from agentflow.machine import Machine, library
from agentflow.machine.brief import LONE_ROOT


@dataclass(frozen=True)
class KnobInfo:
    """One knob of a task."""

    name: str
    """As in `--set`, such as "wall.height"."""
    value: Any
    """Its value in this task."""
    range: str
    """Range and unit ("0 to 5 m"), or the allowed values."""
    help: str
    """What it changes."""


@dataclass(frozen=True)
class TaskInfo:
    """One task: what designers read, and what decides the score."""

    name: str
    """Level, such as "throwing" or "throwing/3"."""
    family: str
    """What its score measures, such as "throwing"."""
    title: str
    """Its name in words."""
    objective: str
    """What the machine must do, in one sentence."""
    scene: tuple[str, ...] = field(repr=False)
    """Sentences about ground, walls, wind and objects, in metres."""
    schedule: tuple[str, ...] = field(repr=False)
    """Sentences about what is switched on when, in seconds since t = 0."""
    score: tuple[str, ...] = field(repr=False)
    """Sentences about how the score is computed, with its unit."""
    window: float = field(repr=False)
    """Length of the scored window, s."""
    blocks: tuple[int, ...] = field(repr=False)
    """Allowed block types."""
    required: Mapping[int, int] = field(repr=False)
    """Block type -> exact number of such blocks."""
    most_blocks: int | None
    """Most blocks of a machine; None without a limit."""
    given: Machine | None = field(repr=False)
    """The blocks that every machine begins with; None if that is a lone root."""
    good: float
    """A good score."""
    greatest: float | None
    """The greatest possible score; None if there is none."""
    record: Mapping[str, Any] | None = field(repr=False)
    """The best known machine: `score`, `verified`, `fragile`, `engine`, `how`, `blocks`; None
    without one."""
    knobs: tuple[KnobInfo, ...] = field(repr=False)
    """What can be changed, with values and ranges."""
    note: str = field(repr=False, default="")
    """What else there is to know."""


def find_task(name: str, settings: Iterable[str] = (), engine: str | None = None) -> Task:
    """A task with `knob=value` settings applied to its level, for the engine of this name; by
    default for the default engine."""
    return get_task(name, dict(map(split_setting, settings)), engine or AUTO)


def list_tasks() -> list[dict[str, Any]]:
    """Every level: the first keys of `task_json`, its good and greatest scores, and its record."""
    keys = ("name", "family", "title", "objective", "window", "blocks", "good", "greatest")
    levels = map(task_json, task_names())
    return [
        {**{key: level[key] for key in (*keys, "record")}, "unit": known_unit(level["name"])}
        for level in levels
    ]


def task_json(name: str, settings: Iterable[str] = ()) -> dict[str, Any]:
    """One level: scene, schedule, score, block list, record, and every knob with its range.

    Args:
        name: Name of a level, or path of a YAML file.
        settings: Strings `knob=value`.
    """
    info = task_info(name, dict(map(split_setting, settings)))
    return {
        **vars(info),
        "block_names": [f"{kind} {library()[kind].name}" for kind in info.blocks],
        "required": {str(kind): count for kind, count in info.required.items()},
        "given": [] if info.given is None else info.given.to_json(),
        "knobs": [vars(knob) for knob in info.knobs],
    }


def task_info(name: str, knobs: Mapping[str, object]) -> TaskInfo:
    """A level with the values of knobs by name; see `task_json`."""
    task, file = get_task(name, knobs), get_level(name).file
    brief = task.brief
    return TaskInfo(
        name=brief.name,
        family=task.family,
        title=file.title,
        objective=brief.objective,
        scene=tuple(brief.scene),
        schedule=tuple(brief.schedule),
        score=tuple(brief.score),
        window=task.window,
        blocks=tuple(brief.blocks),
        required=brief.required,
        most_blocks=brief.limits.blocks,
        given=None if brief.given == LONE_ROOT else brief.given,
        good=file.good,
        greatest=brief.greatest,
        record=record_json(task),
        knobs=tuple(
            KnobInfo(knob.name, value, knob.range, knob.help) for knob, value in knob_table(task)
        ),
        note=file.note,
    )
