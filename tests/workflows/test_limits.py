"""Machines beyond the limits of a task are never simulated, and refiners are told why."""

from __future__ import annotations

from dataclasses import replace

import pytest

from agentflow.machine.brief import Limits
from agentflow.machine.geometry.pieces import largest_piece
from agentflow.machine.geometry.placement import place
from agentflow.machine.tree import Machine
from tests.workflows.fakes import BRIEF, Author, Run

SEARCH = {"trajectories": 3, "search": {"rounds": 4, "width": 2, "request_rounds": 3}}
MOST = 4
LIMITS = {
    "too_many_parts": Limits(parts=MOST),
    "too_many_blocks": Limits(blocks=MOST),
}
TOLD = {
    "too_many_parts": "the machine has 5 parts in one piece; the physics engine holds at most 4",
    "too_many_blocks": "the machine has 5 blocks; this task allows at most 4",
}


class Keeper(dict[str, Machine]):
    """Scores every machine the same and keeps it."""

    def __call__(self, machine: Machine) -> float:
        self[machine.digest] = machine
        return float(len(machine))


@pytest.mark.parametrize("code", LIMITS)
@pytest.mark.parametrize("name", ["iterative", "hierarchical"])
async def test_a_search_spends_no_evaluation_beyond_a_limit(name: str, code: str) -> None:
    run = Run(Author(seed=7, refused=0), SEARCH, brief=replace(BRIEF, limits=LIMITS[code]))
    run.shelf.score = seen = Keeper()
    result = await run(name)
    assert result.best is not None
    assert len(run.shelf.tried) == len(seen) > 3
    assert max(largest_piece(place(machine)) for machine in seen.values()) == MOST
    codes = [data["code"] for data in run.notes.of("attempt").values()]
    assert codes.count(code) > 0
    prompts = [run.prompt(label) for label in run.labels if label.startswith("refiner/feedback")]
    assert any(TOLD[code] in prompt for prompt in prompts)


async def test_random_edits_stay_within_the_budget() -> None:
    run = Run(Author(), SEARCH, brief=replace(BRIEF, limits=LIMITS["too_many_blocks"]))
    run.shelf.score = seen = Keeper()
    result = await run("random-dsl")
    assert result.best is not None
    assert max(len(machine) for machine in seen.values()) == MOST
