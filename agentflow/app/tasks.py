"""Owns how tasks are looked up and shown: the list, and one level with everything about it."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from agentflow.config import override
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.registry import get_level, get_task, knob_table, task_names


def find_task(name: str, settings: Iterable[str] = ()) -> Task:
    """A task with `knob=value` settings laid over its level.

    Raises:
        UnknownNameError: No such task.
        ConfigError: No such knob, or out of range.
    """
    return get_task(name, override({}, (f"knobs.{setting}" for setting in settings)).get("knobs"))


def task_list() -> list[dict[str, Any]]:
    """Every shipped level: name, title, objective, what a good score is."""
    items = []
    for name in task_names():
        level = get_level(name)
        items.append(
            {
                "name": name,
                "title": level.file.title,
                "objective": get_task(name).brief.objective,
                "good": level.file.good,
            }
        )
    return items


def task_json(name: str) -> dict[str, Any]:
    """One level: scene, schedule, score, block list, and every knob with its range."""
    task = get_task(name)
    brief = task.brief
    return {
        "name": brief.name,
        "objective": brief.objective,
        "scene": list(brief.scene),
        "schedule": list(brief.schedule),
        "score": list(brief.score),
        "window": task.window,
        "blocks": list(brief.blocks),
        "required": {str(kind): count for kind, count in brief.required.items()},
        "good": get_level(name).file.good,
        "knobs": [
            {"name": knob.name, "value": value, "range": knob.range, "help": knob.help}
            for knob, value in knob_table(name)
        ],
    }
