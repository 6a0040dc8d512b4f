"""The no-model baseline: three stages, a rollout budget, and nobody asked."""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import pytest

from agentflow.machine.brief import Limits
from agentflow.machine.tree import Machine
from agentflow.machine.validity import check
from agentflow.workflows.base import WorkflowResult
from agentflow.workflows.registry import WORKFLOWS
from agentflow.workflows.settings import WorkflowSettings
from tests.workflows.fakes import BRIEF, Notes, Shelf

TASK = replace(BRIEF, blocks=(0, 1, 2, 15, 63))


def length(found: Machine) -> float:
    return float(len(found))


async def run(
    settings: Mapping[str, Any], shelf: Shelf, *, seed: int = 0
) -> tuple[WorkflowResult, Notes]:
    def nobody(role: str) -> Any:
        raise AssertionError(f"{role} was asked")

    notes = Notes()
    numbers = WorkflowSettings.model_validate(settings)
    return await WORKFLOWS["random-dsl"](TASK, nobody, shelf, numbers, notes, seed), notes


async def test_eight_rollouts_per_stage() -> None:
    shelf = Shelf()
    result, notes = await run({}, shelf)
    assert [(s.name, s.calls, s.tokens, s.rollouts) for s in result.stages] == [
        ("initial", 0, 0, 8),
        ("blind_refinement", 0, 0, 8),
        ("env_feedback", 0, 0, 8),
    ]
    assert len(shelf.tried) == len(set(shelf.tried)) == 24
    assert result.workflow == "random-dsl"
    rows = notes.of("stage")
    assert [rows[stage]["valid_first"] for stage in rows] == [8, 8, 8]
    for stage in result.stages:
        for candidate in stage.survivors:
            assert candidate.machine is not None
            assert check(candidate.machine, TASK).task_valid


@pytest.mark.parametrize("rollouts", [1, 5, 8, 9, 20, 60])
async def test_a_budget_of_rollouts_for_the_whole_run(rollouts: int) -> None:
    shelf = Shelf()
    result, _ = await run({"max_simulations": rollouts}, shelf)
    assert len(shelf.tried) == rollouts == sum(stage.rollouts for stage in result.stages)
    assert result.stages[0].rollouts == min(8, rollouts)
    assert len(result.stages) == (1 if rollouts <= 8 else 2 if rollouts <= 16 else 3)


async def test_selection_is_by_score_alone() -> None:
    """Only a strictly better machine takes over; the next edit is of the best."""
    _, notes = await run({"trajectories": 2, "max_simulations": 40}, Shelf(length))
    best = dict[str, str]()
    lengths = {digest: text.count('"type"') for digest, text in notes.machines.items()}
    kept = 0
    for label, data in notes.of("edit").items():
        place = label.split("/")[1]
        assert data["parent"] == best.setdefault(place, data["parent"])
        assert data["kept"] == (lengths[data["machine"]] > lengths[data["parent"]])
        if data["kept"]:
            best[place], kept = data["machine"], kept + 1
    assert kept > 5


async def test_a_climb_begins_at_the_better_of_two_machines_the_first_among_equals() -> None:
    scores = iter([1.0, 2.0, 3.0, 2.0, 2.0, 2.0, 0.0, 0.0, 0.0])
    _, notes = await run({"trajectories": 3, "max_simulations": 9}, Shelf(lambda _: next(scores)))
    tried, edits = notes.of("evaluation"), notes.of("edit")
    for number, stage in enumerate(("blind_refinement", "initial", "initial"), start=1):
        start = edits[f"env_feedback/traj-{number}/round-1"]["parent"]
        assert start == tried[f"{stage}/traj-{number}"]["machine"]


@pytest.mark.parametrize("score", [length, lambda _: 1.0], ids=["longer", "equal"])
async def test_a_climb_tries_no_machine_twice(score: Callable[[Machine], float]) -> None:
    _, notes = await run({"trajectories": 1, "max_simulations": 30}, Shelf(score), seed=8)
    edits = list(notes.of("edit").values())
    tried = [edits[0]["parent"], *(edit["machine"] for edit in edits)]
    assert len(set(tried)) == len(tried) > 25


async def test_a_result_is_never_worse_than_what_was_seen() -> None:
    result, notes = await run({"trajectories": 3, "max_simulations": 30}, Shelf())
    scores = [event["score"] for event in notes.of("evaluation").values()]
    assert result.best is not None
    assert result.best.score == max(scores)


@pytest.mark.slow
async def test_completion_order_changes_nothing() -> None:
    seen = []
    for seed in range(3):
        result, notes = await run(
            {"max_simulations": 40}, Shelf(delays=random.Random(seed)), seed=3
        )
        seen.append((result, notes.events))
    assert all(item == seen[0] for item in seen)
    other, _ = await run({"max_simulations": 40}, Shelf(), seed=4)
    assert other.best != seen[0][0].best


@pytest.mark.slow
async def test_a_task_that_no_random_machine_meets_is_a_result() -> None:
    numbers = WorkflowSettings(trajectories=1)
    task = replace(TASK, limits=Limits((1.0, 1.0, 1.0)))
    result = await WORKFLOWS["random-dsl"](task, lambda _: None, Shelf(), numbers, Notes())  # type: ignore
    assert result.best is None
    assert result.reason == (
        "no valid machine: found no valid machine of 5 to 20 blocks for this task; "
        "allowed types: 1, 2, 15, 63"
    )
