"""Design objectives and their function tests, on real rollouts."""

from __future__ import annotations

from pathlib import Path

import pytest

from agentflow.env.simulation.simulate import simulate
from agentflow.machine.tree import Machine
from agentflow.training.objectives import OBJECTIVES, Objective, Verdict, read_objectives, works
from tests.env.machines import CAR, machine

REPOSITORY = Path(__file__).parents[2]
OBJECTIVES_FILE = REPOSITORY / OBJECTIVES
DECORATION = machine((0, -1, -1), (63, 0, 0), (63, 0, 1), (1, 0, 4))
"""A root with three beams."""


def judge(tree: Machine, test: dict[str, object], level: str, **knobs: object) -> Verdict:
    """Simulate a machine and apply function tests."""
    objective = Objective.model_validate(
        {
            "name": "tried",
            "text": "Do it.",
            "kind": "function",
            "blocks": sorted({0, *(step.type for step in tree)}),
            "scene": {"level": level, "knobs": knobs},
            "test": test,
        }
    )
    return works(objective, simulate(tree, objective.task), tree)


def test_a_car_moves_and_a_decoration_does_not() -> None:
    test = {"moves": {"metres": 5, "towards": "z+"}}
    assert judge(CAR, test, "movement").passed
    verdict = judge(DECORATION, test, "movement")
    assert not verdict.passed
    assert verdict.found["moves.metres"].value == pytest.approx(0, abs=0.05)


def test_the_objectives_that_come_with_the_code_can_be_read() -> None:
    for objective in read_objectives(OBJECTIVES_FILE):
        assert objective.task.brief.objective == objective.text
