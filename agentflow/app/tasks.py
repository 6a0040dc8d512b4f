"""Tasks: list the levels, or show one in full."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from agentflow.config.run import split_setting
from agentflow.env.physics.engine import AUTO
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.records import record_json
from agentflow.env.tasks.registry import get_level, get_task, knob_table, task_names
from agentflow.machine.blocks.library import library
from agentflow.machine.brief import LONE_ROOT


def find_task(name: str, settings: Iterable[str] = (), engine: str | None = None) -> Task:
    """A task with `knob=value` settings applied to its level, for the engine of this name; by
    default for the default engine."""
    return get_task(name, dict(map(split_setting, settings)), engine or AUTO)


def list_tasks() -> list[dict[str, Any]]:
    """Every level: the first keys of `task_json`, its good and greatest scores, and its record."""
    keys = ("name", "family", "title", "objective", "window", "blocks", "good", "greatest")
    levels = map(task_json, task_names())
    return [{key: level[key] for key in (*keys, "record")} for level in levels]


def task_json(name: str, settings: Iterable[str] = ()) -> dict[str, Any]:
    """One level: scene, schedule, score, block list, record, and every knob with its range.

    Args:
        name: Name of a level, or path of a YAML file.
        settings: Strings `knob=value`.
    """
    return describe_task(name, dict(map(split_setting, settings)))


def describe_task(name: str, knobs: Mapping[str, object]) -> dict[str, Any]:
    """As `task_json`, with the values of knobs by name."""
    task, file = get_task(name, knobs), get_level(name).file
    brief = task.brief
    return {
        "name": brief.name,
        "family": task.family,
        "title": file.title,
        "objective": brief.objective,
        "scene": list(brief.scene),
        "schedule": list(brief.schedule),
        "score": list(brief.score),
        "window": task.window,
        "blocks": list(brief.blocks),
        "block_names": [f"{kind} {library()[kind].name}" for kind in brief.blocks],
        "required": {str(kind): count for kind, count in brief.required.items()},
        "most_blocks": brief.limits.blocks,
        "given": [] if brief.given == LONE_ROOT else brief.given.to_json(),
        "good": file.good,
        "greatest": brief.greatest,
        "record": record_json(task),
        "note": file.note,
        "knobs": [
            {"name": knob.name, "value": value, "range": knob.range, "help": knob.help}
            for knob, value in knob_table(task)
        ],
    }
