"""The tasks and blocks that there are, as objects."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from agentflow.app.tasks import describe_task
from agentflow.env.tasks.registry import knob_names, task_names
from agentflow.machine import BlockType, Machine, library, read_machine


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


def tasks() -> tuple[TaskInfo, ...]:
    """Every task, as `agentflow tasks` lists them; see `task`."""
    return tuple(map(task, task_names()))


def task(name: str, **knobs: object) -> TaskInfo:
    """One task: scene, schedule, score, knobs with their ranges, record, a good score.

    Args:
        name: Level, such as "throwing" or "throwing/3", or path of a level's YAML file.
        **knobs: Knobs to change. Where their name has a dot, write an underscore:
            `task("throwing", wall_height=2)`.

    Raises:
        UsageError: The task or a knob does not exist, or a value is out of range.
    """
    found = describe_task(name, knob_names(name, knobs))
    given = read_machine(found["given"], tuple(library())).machine if found["given"] else None
    lists = {key: tuple(found[key]) for key in ("scene", "schedule", "score", "blocks")}
    known = {key: value for key, value in found.items() if key in TaskInfo.__dataclass_fields__}
    return TaskInfo(
        **{
            **known,
            **lists,
            "required": {int(kind): count for kind, count in found["required"].items()},
            "given": given,
            "knobs": tuple(KnobInfo(**knob) for knob in found["knobs"]),
        }
    )


def blocks() -> tuple[BlockType, ...]:
    """Every block type, by number: size, mass, faces and behaviour in the block's own frame."""
    return tuple(library().values())
