"""Tasks for users: the list of levels, and one level in full."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from agentflow.config.run import split_setting
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.registry import get_level, get_task, knob_table, task_names
from agentflow.machine.blocks.library import library
from agentflow.machine.brief import LONE_ROOT


def find_task(name: str, settings: Iterable[str] = ()) -> Task:
    """A task with `knob=value` settings applied to its level.

    Raises:
        UnknownNameError: There is no such task.
        ConfigError: A knob is unknown or out of range.
    """
    return get_task(name, dict(map(split_setting, settings)))


def list_tasks() -> list[dict[str, Any]]:
    """Every level: name, title, objective, window, block list, and what a good score is."""
    items = []
    for name in task_names():
        level, task = get_level(name), get_task(name)
        items.append(
            {
                "name": name,
                "family": task.family,
                "title": level.file.title,
                "objective": task.brief.objective,
                "window": task.window,
                "blocks": list(task.brief.blocks),
                "good": level.file.good,
            }
        )
    return items


def task_json(name: str, settings: Iterable[str] = ()) -> dict[str, Any]:
    """One level: scene, schedule, score, block list, and every knob with its range.

    Args:
        name: Name of a level, or path of a YAML file.
        settings: Strings `knob=value`.

    Raises:
        UnknownNameError: There is no such task.
        ConfigError: A knob is unknown or out of range.
    """
    task, file = find_task(name, settings), get_level(name).file
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
        "given": [] if brief.given == LONE_ROOT else brief.given.to_json(),
        "good": file.good,
        "note": file.note,
        "knobs": [
            {"name": knob.name, "value": value, "range": knob.range, "help": knob.help}
            for knob, value in knob_table(task)
        ],
    }
