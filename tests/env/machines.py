"""Machines that several tests of the environment use."""

from __future__ import annotations

from pathlib import Path

from agentflow.env.tasks.base import Task
from agentflow.env.tasks.registry import get_task
from agentflow.machine.blocks.library import BOULDER
from agentflow.machine.formats.parse import read_machine
from agentflow.machine.tree import Machine, Step
from tests.machine.builders import CAR, CATAPULT

__all__ = ["BALLASTED", "CAR", "CRADLE", "PRINTED", "SHIPPED", "machine", "shipped", "task_of"]

Row = tuple[int, ...]


def machine(*rows: Row) -> Machine:
    """A machine from (type, parent, face) rows, or (type, parent, face, parent, face)."""
    return Machine(tuple(Step(i, *row) for i, row in enumerate(rows)))


PRINTED = CATAPULT
"""The printed blocks of the one published rollout; blocks 14 to 16 are known in words only."""

BALLASTED = machine(*((s.type, s.parent, s.face_id) for s in PRINTED), (35, 10, 0))
"""The same with the ballast where the words suggest it."""

CRADLE = machine(
    (0, -1, -1), (35, 0, 0), (35, 0, 1), (35, 0, 2), (35, 0, 3), (30, 0, 4), (36, 5, 0)
)
"""A boulder in an upright container on a heavy cross."""

FOLDER = Path(__file__).parent.parent / "machines"
SHIPPED = tuple(sorted(path.stem for path in FOLDER.glob("*.json")))
"""Names of the machines that are kept as files."""


def shipped(name: str) -> Machine:
    """A machine that is kept as a file."""
    reading = read_machine((FOLDER / f"{name}.json").read_text(encoding="utf-8"))
    assert reading.machine is not None, reading.problems
    return reading.machine


def task_of(tree: Machine, **knobs: object) -> Task:
    """The task that a machine is made for: throwing if it has a boulder, else movement."""
    return get_task("throwing" if tree.count(BOULDER) else "movement", knobs)
