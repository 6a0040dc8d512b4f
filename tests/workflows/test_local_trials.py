"""Local trials: simulated before the refiner is asked, told to it, counted, and drawn once."""

from __future__ import annotations

import asyncio
import random
from dataclasses import replace
from typing import Any

import pytest

from agentflow.agents.refiner import Refiner
from agentflow.llm.messages import Reply, Request
from agentflow.machine.tree import Machine
from agentflow.runs.locations import FEEDBACK
from agentflow.search.node import Evaluation, Node
from agentflow.tools.host import SimulationSummary
from agentflow.workflows.context import WorkflowContext
from agentflow.workflows.registry import WORKFLOWS
from agentflow.workflows.settings import WorkflowSettings
from agentflow.workflows.stages.feedback import Revision, Trajectory
from tests.scripted import ScriptedClient
from tests.workflows.fakes import BRIEF, Author, Run, Script, Shelf, edit, fenced, machine, steps

SEARCH = {"rounds": 2, "width": 2, "request_rounds": 2}
SETTINGS: dict[str, Any] = {"trajectories": 3, "local_trials": 4, "search": SEARCH}
HEAD = "Trials of single edits around this machine"
REFINER = "refiner/feedback/traj-1/round-1/node-0/try-1/attempt-1"


def with_strategy(strategy: str, **more: object) -> dict[str, Any]:
    return {**SETTINGS, **more, "search": {**SEARCH, "strategy": strategy}}


@pytest.mark.parametrize("strategy", ["mcts", "best_of_n", "ab-mcts"])
@pytest.mark.parametrize("name", ["hierarchical", "iterative", "single"])
async def test_refiners_read_what_edits_do(name: str, strategy: str) -> None:
    run = Run(Author(seed=5), with_strategy(strategy, max_simulations=40))
    result = await run(name)
    assert result.best is not None
    assert sum(stage.rollouts for stage in result.stages) == len(set(run.shelf.tried)) <= 40
    events = run.notes.of("local_trials")
    assert events
    for label, data in events.items():
        assert len(data["trials"]) <= 4
        for number, trial in enumerate(data["trials"], start=1):
            trajectory, node = label.split("/")[1:]
            at = f"env_feedback/{trajectory}/candidate-{number}/{node}"
            assert run.notes.of("evaluation")[at]["machine"] == trial["machine"]
        asked = [item for item in run.labels if item.startswith(_asked(label))]
        assert all(data["text"] in run.prompt(item) for item in asked)
    assert any(HEAD in run.prompt(item) for item in run.labels if "refiner/feedback" in item)


def _asked(label: str) -> str:
    """Beginning of the labels of refiners of the first expansion of a node."""
    _, trajectory, node = label.split("/")
    return f"refiner/feedback/{trajectory}/round-1/{node}/"


@pytest.mark.parametrize("strategy", ["mcts", "ab-mcts"])
async def test_trials_do_not_depend_on_the_order_of_answers(strategy: str) -> None:
    seen = []
    for seed in range(3):
        delays = random.Random(seed)
        settings = with_strategy(strategy, max_simulations=60)
        run = Run(Author(seed=4), settings, shelf=Shelf(delays=delays), delays=delays)
        result = await run("iterative")
        prompts = {request.label: request.messages for request in run.client.requests}
        seen.append((result, run.notes.events, prompts))
    assert all(item == seen[0] for item in seen)
    assert len({data["machine"] for data in seen[0][1].values() if "trials" in data}) > 1


async def test_nothing_is_tried_by_default() -> None:
    run = Run(Author(seed=5), {**SETTINGS, "local_trials": 0})
    await run("iterative")
    assert not run.notes.of("local_trials")
    assert not any(HEAD in run.prompt(label) for label in run.labels)


CART = fenced(steps((1, 0, 0), (2, 0, 2)))
NO_CHANGE = edit("")


def one_try(request: Request) -> Reply:
    text = NO_CHANGE if request.role == "refiner" else CART
    return Script({request.label: text})(request)


async def test_a_trial_can_be_the_result() -> None:
    """Although the refiner changes nothing."""
    settings = {**SETTINGS, "trajectories": 1, "inspector": False, "querier": False}
    run = Run(one_try, settings, shelf=Shelf(lambda machine: float(len(machine))))
    result = await run("iterative")
    assert result.best is not None
    assert result.best_stage == "env_feedback"
    assert result.best.score is not None
    assert result.best.score > 3.0
    digest = result.best.machine.digest if result.best.machine else ""
    tried = [t for data in run.notes.of("local_trials").values() for t in data["trials"]]
    assert digest in {trial["machine"] for trial in tried}


async def test_a_perfect_trial_ends_the_search_without_a_refiner() -> None:
    settings = {**SETTINGS, "trajectories": 1, "inspector": False, "querier": False}
    brief = replace(BRIEF, greatest=4.0)
    run = Run(one_try, settings, shelf=Shelf(lambda m: float(len(m))), brief=brief)
    result = await run("iterative")
    assert result.stopped == "greatest score"
    assert not [label for label in run.labels if label.startswith("refiner/feedback")]


@pytest.mark.parametrize("novelty", [True, False])
async def test_a_machine_in_another_order_is_not_simulated(novelty: bool) -> None:
    """A refiner that only renumbers blocks is told so, and asked again, unless that is off."""
    first = fenced(steps((1, 0, 0), (1, 0, 1), (2, 0, 2)))
    twin = edit(fenced(steps((2, 0, 2), (1, 0, 1), (1, 0, 0))))

    def answer(request: Request) -> Reply:
        text = {"refiner": twin, "designer": first}[request.role]
        text = NO_CHANGE if request.label.startswith("refiner/blind") else text
        return Script({request.label: text})(request)

    settings = {"trajectories": 1, "inspector": False, "querier": False, "search": SEARCH}
    run = Run(answer, settings | {"novelty": novelty})
    await run("iterative")
    assert len(set(run.shelf.tried)) == 1 + (not novelty)
    if not novelty:
        return
    (expanded,) = [d for label, d in run.notes.of("expand").items() if label.endswith("round-1")]
    assert "only in the numbers of its blocks" in expanded["attempts"][0]["note"]
    again = run.prompt(REFINER.replace("try-1", "try-3"))
    assert "or is its mirror image: make a different change" in again


@pytest.mark.parametrize("first", [1, 2])
async def test_twins_do_not_depend_on_the_order_of_answers(first: int) -> None:
    """Two nodes are refined at once, to machines that differ only in the order of their blocks;
    whichever answer comes first, either machine may come again."""
    labels = ["round-1/node-1/try-1", "round-1/node-2/try-1", "round-2/node-1/try-1"]
    added = {1: edit("Add 1 to 0 in 1"), 2: edit("Add 1 to 0 in 0")}
    answered = asyncio.Event()

    class InOrder(ScriptedClient):
        async def complete(self, request: Request) -> Reply:
            if f"round-1/node-{first}/" in request.label:
                answered.set()
            else:
                await answered.wait()
            return await super().complete(request)

    def answer(request: Request) -> Reply:
        number = 2 if "node-2" in request.label else 1
        return Script({request.label: added[number]})(request)

    run = Run(answer, {"querier": False}, client=InOrder(answer))
    context = WorkflowContext(
        "iterative", BRIEF, run.context, run.shelf, run.settings, run.notes, run.seed
    )
    context.begin_stage(FEEDBACK)
    trajectory = Trajectory(context, 1)
    nodes = [_node(1, machine((2, 0, 2), (1, 0, 0))), _node(2, machine((2, 0, 2), (1, 0, 1)))]
    jobs = [
        trajectory.expand(node, [label], ()) for node, label in zip(nodes, labels, strict=False)
    ]
    made = [item for found in await asyncio.gather(*jobs) for item in found]
    for attempt in made:
        assert attempt.candidate is not None
        await trajectory.evaluate(attempt.candidate, attempt.label)
    (again,) = await trajectory.expand(nodes[0], labels[2:], ())
    assert again.candidate is not None
    assert again.candidate == made[0].candidate != made[1].candidate


def _node(number: int, found: Machine) -> Node[Revision]:
    summary = SimulationSummary(1.0, "ok", "", (), found.digest)
    return Node(number, Revision(found, label=f"node-{number}"), 0, Evaluation(True, 1.0, summary))


def test_estimates_count_them() -> None:
    iterative, single = WORKFLOWS["iterative"], WORKFLOWS["single"]
    settings = WorkflowSettings.model_validate(SETTINGS)
    assert iterative.rollouts(settings) == 3 * (2 + 2 * (2 + 4))
    assert single.rollouts(single.adapt(settings)) == 3 * (1 + 2 * (1 + 4))
    pooled = WorkflowSettings.model_validate(with_strategy("ab-mcts", max_simulations=60))
    assert iterative.calls(pooled)[Refiner.name] == 30 // (2 + 4)


@pytest.mark.parametrize("wrong", [-1, 1001, "many", 2.5])
def test_the_number_is_checked(wrong: object) -> None:
    with pytest.raises(ValueError, match="local_trials"):
        WorkflowSettings.model_validate({"local_trials": wrong})


async def test_a_gain_takes_the_place_of_a_refiner_that_failed() -> None:
    """Several refiners of one machine: fewer are asked again than have failed."""
    settings = with_strategy("half-and-half", trajectories=6, emitters=["refiner"])
    run = Run(Author(seed=0, refused=0.6), {**settings, "max_simulations": 60}, max_retry=1)
    result = await run("iterative")
    assert result.best is not None
    asked = [_attempts(data) for data in run.notes.of("expand").values()]
    assert any(gained and failed > 1 for gained, failed in asked)
    assert len(set(run.shelf.tried)) <= 60


def _attempts(expanded: dict[str, Any]) -> tuple[int, int]:
    """How many attempts nobody was asked for, and how many failed."""
    made = expanded["attempts"]
    besides = sum("try-" not in attempt["label"] for attempt in made)
    return besides, sum(not attempt["valid"] for attempt in made)
