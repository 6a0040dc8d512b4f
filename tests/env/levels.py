"""Levels that only tests have: no family lets machines bring controls of their own yet."""

from __future__ import annotations

from typing import Any

from agentflow.env.tasks.base import Task
from agentflow.env.tasks.registry import Level, LevelFile, make_task


def designed_level(**parameters: Any) -> Level:
    """A level of movement where machines bring their own controls."""
    file = LevelFile(
        family="movement", title="drive", good=1.0, controls="designed", parameters=parameters
    )
    return Level("designed.yaml", 0, file)


def designed_task(engine: str = "auto", **parameters: Any) -> Task:
    """Its task."""
    return make_task(designed_level(**parameters), engine=engine)
