"""Runs of tasks with a greatest possible score, and edits that change nothing."""

from __future__ import annotations

from dataclasses import replace
from importlib.metadata import EntryPoint

import pytest

from agentflow.errors import PluginError
from agentflow.machine.tree import Machine
from agentflow.search.registry import STRATEGIES
from agentflow.workflows.registry import WORKFLOWS
from agentflow.workflows.settings import WorkflowSettings
from tests.workflows.fakes import BRIEF, Author, Notes, Run, Shelf, edit, machine

CAPPED = replace(BRIEF, greatest=4.0)
START = machine((1, 0, 0), (2, 0, 2))


def length(found: Machine) -> float:
    return float(len(found))


class Extender(Author):
    """An author whose refiner adds a block behind, or answers with a fixed script."""

    def __init__(self, script: str | None = None) -> None:
        super().__init__(refused=0.0)
        self.script = script

    def refiner(self, prompt: str, chance: object) -> str:  # noqa: ARG002
        count = prompt.count('"parent"')
        return edit(f"Add 1 to {count - 2} in 0" if self.script is None else self.script)


def refine(script: str | None, **settings: object) -> Run:
    start = START.to_json()
    return Run(
        Extender(script),
        {"trajectories": 1, "querier": False, "start": start, **settings},
        shelf=Shelf(length),
        brief=CAPPED,
    )


@pytest.mark.parametrize("strategy", ["mcts", "best_of_n", "random"])
async def test_a_search_ends_at_the_greatest_score(strategy: str) -> None:
    run = refine("Add 1 to 0 in 4", search={"strategy": strategy, "rounds": 4, "width": 1})
    result = await run("iterative")
    assert result.best is not None
    assert (result.best.score, result.stopped) == (4.0, "greatest score")
    assert [label.partition("/")[2] for label in run.labels] == [
        "feedback/traj-1/round-1/node-0/try-1/attempt-1"
    ]
    (end,) = run.notes.of("search").values()
    assert (end["reason"], end["stopped"], end["expansions"]) == ("greatest score", False, 1)


async def test_a_strategy_that_returns_something_else_is_named(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async def best_score(*_: object) -> float:
        return 4.0

    entry = EntryPoint("mine", "own:best_score", "agentflow.strategies")
    monkeypatch.setitem(vars(STRATEGIES), "_others", {"mine": entry})
    monkeypatch.setitem(STRATEGIES._loaded, "mine", best_score)
    with pytest.raises(PluginError) as caught:
        await refine("Add 1 to 0 in 4", search={"strategy": "mine"})("iterative")
    assert str(caught.value) == (
        "the search strategy 'mine' (own:best_score) must return a SearchResult, such as "
        "tree.result(tree.best()), not float"
    )


async def test_a_machine_with_the_greatest_score_is_not_refined() -> None:
    shelf = Shelf(lambda _: 4.0)
    run = Run(Author(refused=0.0), {"trajectories": 2}, shelf=shelf, brief=CAPPED)
    result = await run("iterative")
    assert {label.partition("/")[0] for label in run.labels} == {"designer"}
    assert [(stage.name, stage.rollouts) for stage in result.stages][1:] == [
        ("blind_refinement", 0),
        ("env_feedback", 0),
    ]
    assert [len(stage.survivors) for stage in result.stages] == [2, 2, 2]
    assert [row["valid_first"] for row in run.notes.of("stage").values()] == [2, 2, 2]
    assert (result.best_stage, result.stopped) == ("initial", "greatest score")
    assert {end["reason"] for end in run.notes.of("search").values()} == {"greatest score"}


async def test_random_edits_end_at_the_greatest_score() -> None:
    def nobody(role: str) -> None:
        raise AssertionError(f"{role} was asked")

    async def rollouts(greatest: float) -> tuple[int, str | None]:
        shelf, brief = Shelf(length), replace(BRIEF, greatest=greatest)
        numbers = WorkflowSettings(trajectories=2, max_simulations=60, start=tuple(START.to_json()))
        workflow = WORKFLOWS["random-dsl"]
        result = await workflow(brief, nobody, shelf, numbers, Notes(), 0)  # type: ignore[arg-type]
        return len(shelf.tried), result.stopped

    assert await rollouts(3.0) == (1, "greatest score")
    some, why = await rollouts(5.0)
    assert 1 < some < 60
    assert why == "greatest score"
    assert await rollouts(1000.0) == (60, None)


@pytest.mark.parametrize("strategy", ["mcts", "best_of_n", "random"])
async def test_an_edit_that_changes_nothing_costs_no_simulation(strategy: str) -> None:
    run = refine("", search={"strategy": strategy, "rounds": 2, "width": 1})
    result = await run("iterative")
    assert len(run.shelf.tried) == 1
    assert [node["score"] for node in run.notes.of("node").values()] == [3.0, 3.0]
    assert {node["machine"] for node in run.notes.of("node").values()} == {START.digest}
    assert (result.best_stage, result.stopped) == ("initial", None)


async def test_a_blind_refinement_may_change_nothing() -> None:
    author = Extender("none")
    run = Run(author, {"trajectories": 1, "search": {"rounds": 0}}, shelf=Shelf(length))
    result = await run("iterative")
    first, blind = (stage.candidates[0] for stage in result.stages)
    assert blind.valid
    assert blind.machine == first.machine
    assert [stage.rollouts for stage in result.stages] == [1, 0]
