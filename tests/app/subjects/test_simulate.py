"""Simulating the trials of one machine in several processes."""

from __future__ import annotations

from pathlib import Path

import pytest

from agentflow.app.machines.files import read_one
from agentflow.app.subjects.subject import Subject, simulate_in_parallel
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.registry import get_task
from agentflow.machine import ROOT, Machine

TOSSER = Path(__file__).parents[2] / "machines" / "jumping" / "tossing_arm.json"
TASK = get_task("jumping", {"window": 1})


@pytest.mark.slow
def test_trials_in_parallel_give_the_same_rollout() -> None:
    machine = read_one(str(TOSSER))
    told: list[tuple[int, int]] = []
    found = simulate_in_parallel(
        Subject(machine, TASK, 3), workers=2, say=lambda *done: told.append(done), interval=0.1
    )
    alone = simulate(machine, TASK, seed=3, interval=0.1)
    assert (found.digest, found.score, found.terms) == (alone.digest, alone.score, alone.terms)
    assert told == [(number, 10) for number in range(1, 11)]


def test_a_single_trial_needs_no_process() -> None:
    def never(_done: int, _of: int) -> None:
        raise AssertionError("nothing to tell")

    task = get_task("movement", {"window": 1})
    found = simulate_in_parallel(Subject(Machine((ROOT,)), task), workers=4, say=never)
    assert found.digest == simulate(Machine((ROOT,)), task).digest
