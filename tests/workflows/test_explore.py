"""The workflow explore: machines of many kinds, within a budget of rollouts."""

from __future__ import annotations

import random
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import pytest

from agentflow.machine.validity import check
from agentflow.workflows.base import WorkflowResult
from agentflow.workflows.registry import WORKFLOWS
from agentflow.workflows.settings import WorkflowSettings
from tests.workflows.fakes import BLOCKS, BRIEF, Author, Notes, Run, Shelf

pytest.importorskip("ribs")

TASK = replace(BRIEF, blocks=(0, 1, 2, 15, 63))


async def run(
    settings: Mapping[str, Any], shelf: Shelf, seed: int = 0
) -> tuple[WorkflowResult, Notes]:
    def nobody(role: str) -> Any:
        raise AssertionError(f"{role} was asked")

    notes = Notes()
    numbers = WorkflowSettings.model_validate(settings)
    return await WORKFLOWS["explore"](TASK, nobody, shelf, numbers, notes, seed), notes


@pytest.mark.parametrize("rollouts", [1, 2, 3, 20])
async def test_the_budget_of_rollouts_is_used_up_and_kept(rollouts: int) -> None:
    shelf = Shelf()
    result, notes = await run({"trajectories": 2, "max_simulations": rollouts}, shelf)
    assert len(set(shelf.tried)) == len(shelf.tried) == rollouts
    assert sum(stage.rollouts for stage in result.stages) == rollouts
    assert len(notes.of("archive")) == (2 if rollouts > 2 else 0)


async def test_machines_are_valid_and_every_cell_keeps_its_best() -> None:
    result, notes = await run({"trajectories": 1, "max_simulations": 40}, Shelf())
    filed = list(notes.of("niche").values())
    assert notes.of("archive")["env_feedback/traj-1"]["axes"] == [{**vars(BLOCKS), "labels": []}]
    best: dict[tuple[int, ...], float] = {}
    for item in filed:
        cell, score = tuple(item["cell"]), item["score"]
        expected = "new" if cell not in best else "better" if score > best[cell] else "worse"
        assert item["outcome"] == expected
        best[cell] = max(best.get(cell, score), score)
    assert len(best) > 2
    assert result.best is not None
    assert result.best.score == max(best.values())
    for stage in result.stages:
        for candidate in stage.survivors:
            assert candidate.machine is not None
            assert check(candidate.machine, TASK).task_valid


async def test_the_seed_and_nothing_else_decides() -> None:
    """Simulations that end in any order make the same events."""
    settings = {"trajectories": 2, "max_simulations": 24}
    _, one = await run(settings, Shelf())
    _, two = await run(settings, Shelf(delays=random.Random(1)))
    _, other = await run(settings, Shelf(), seed=1)
    assert one.events == two.events
    assert one.events != other.events


async def test_both_random_emitters_are_used() -> None:
    _, notes = await run({"trajectories": 1, "max_simulations": 60}, Shelf())
    told = [item["note"] for event in notes.of("expand").values() for item in event["attempts"]]
    assert {"random edit", "crossover"} <= set(told)


async def test_refiners_are_told_which_kind_to_aim_at() -> None:
    settings = {"emitters": ["refiner"], "trajectories": 1, "max_simulations": 9, "querier": False}
    asked = Run(Author(seed=3, refused=0.0), settings)
    await asked("explore")
    labels = [label for label in asked.labels if label.startswith("refiner/feedback")]
    assert labels
    told = asked.prompt(labels[0])
    assert "Machines of other kinds are wanted too: make one whose blocks is" in told
    assert asked.labels[0].startswith("designer/")


async def test_answers_in_any_order_make_the_same_run() -> None:
    settings = {"emitters": ["refiner", "edit"], "trajectories": 2, "max_simulations": 20}
    one, two = (Run(Author(seed=3), settings, delays=d) for d in (None, random.Random(2)))
    await one("explore")
    await two("explore")
    assert one.notes.events == two.notes.events


async def test_a_greatest_score_does_not_end_the_search() -> None:
    notes, shelf = Notes(), Shelf(lambda _: 5.0)
    numbers = WorkflowSettings.model_validate({"trajectories": 1, "max_simulations": 12})
    task = replace(TASK, greatest=5.0)

    def nobody(role: str) -> Any:
        raise AssertionError(f"{role} was asked")

    await WORKFLOWS["explore"](task, nobody, shelf, numbers, notes, 0)
    assert len(shelf.tried) == 12
