"""What all workflows have in common: order does not matter, budgets stop, machines run once."""

import random
import re
from collections import Counter
from dataclasses import replace
from typing import Any

import pytest

from agentflow.agents.registry import ROLES
from agentflow.errors import UnknownNameError, UnreachableError
from agentflow.machine.brief import Brief
from agentflow.machine.edits.local import local_edit
from agentflow.machine.tree import Machine
from agentflow.search.node import Evaluation
from agentflow.search.registry import STRATEGIES
from agentflow.search.strategies import deals_budget
from agentflow.workflows.registry import WORKFLOWS
from agentflow.workflows.settings import WorkflowSettings
from agentflow.workflows.stages import pooled as stages_pooled
from tests.workflows.fakes import (
    BRIEF,
    CRITIQUE,
    INQUIRY,
    Author,
    Run,
    Script,
    Shelf,
    by_digest,
    edit,
    fenced,
    machine,
    machine_in,
    steps,
)

ASKING = [name for name, flow in WORKFLOWS.items() if flow.asks_models and flow.fits(BRIEF)]
APART = ("external", "tune")
WITHOUT_PROGRAM = [n for n, flow in WORKFLOWS.items() if flow.fits(BRIEF) and n not in APART]
"""Workflows for this task that need neither an agent program nor a machine with controls."""
MEDIUM = {"trajectories": 4, "search": {"rounds": 3, "width": 2, "request_rounds": 2}}


def test_by_name() -> None:
    with pytest.raises(UnknownNameError) as caught:
        WORKFLOWS["hierachical"]
    assert str(caught.value) == (
        "unknown workflow 'hierachical'; known: hierarchical, iterative, single, tools, "
        "random-dsl, explore, external, tune, ..."
    )


@pytest.mark.parametrize("name", WORKFLOWS)
def test_every_workflow_is_complete(name: str) -> None:
    flow = WORKFLOWS[name]
    assert flow.name == name
    settings = flow.adapt(WorkflowSettings())
    assert flow.rollouts(settings) > 0
    assert bool(flow.calls(settings)) == flow.asks_models
    assert set(flow.calls(settings)) <= set(ROLES)


SEARCHING = ("hierarchical", "iterative")
"""Workflows that search with the strategy of the settings."""


def deals(name: str, strategy: str) -> bool:
    """Whether the search deals the budget of the whole run."""
    return name in SEARCHING and deals_budget(strategy)


@pytest.mark.parametrize("name", ASKING)
@pytest.mark.parametrize("strategy", STRATEGIES)
async def test_every_workflow_with_every_strategy(name: str, strategy: str) -> None:
    run = Run(Author(seed=5), {**MEDIUM, "search": {**MEDIUM["search"], "strategy": strategy}})  # type: ignore[dict-item]
    result = await run(name)
    assert result.workflow == name
    assert [stage.name for stage in result.stages] == [
        "initial",
        *(["blind_refinement"] if not (name == "single" or deals(name, strategy)) else []),
        "env_feedback",
    ]
    assert result.best is not None
    scores = [c.score for stage in result.stages for c in stage.survivors if c.score is not None]
    assert result.best.score == max(scores)
    assert len(run.labels) == len(set(run.labels)) == sum(s.calls for s in result.stages)
    assert len(run.shelf.tried) == len(set(run.shelf.tried))
    assert len(run.shelf.tried) == sum(stage.rollouts for stage in result.stages)


@pytest.mark.parametrize("name", WITHOUT_PROGRAM)
async def test_every_workflow_improves_a_start_machine(name: str) -> None:
    start = machine((2, 0, 2))
    flow, settings = WORKFLOWS[name], {**MEDIUM, "start": start.to_json()}
    run = Run(Author(seed=5, refused=0.0), settings)
    result = await run(name)
    initial, *later = result.stages
    assert {candidate.machine for candidate in initial.candidates} == {start}
    assert (initial.calls, initial.rollouts) == (0, 1)
    assert [stage.name for stage in later] == [
        *(["blind_refinement"] if name == "random-dsl" else []),
        "env_feedback",
    ]
    assert later[-1].rollouts > 0
    assert result.best is not None
    assert result.best.score is not None
    assert result.best.score >= by_digest(start)
    asked = {request.role for request in run.client.requests}
    expected = flow.calls(flow.adapt(run.settings))
    assert asked == {role for role, count in expected.items() if count}
    for label in run.labels:
        if "/round-1/node-0/" in label:
            assert machine_in(run.prompt(label)) == start


@pytest.mark.slow
@pytest.mark.parametrize("name", ASKING)
async def test_completion_order_changes_nothing(name: str) -> None:
    """Replies and rollouts delayed at random: the same events, whatever their order."""
    seen = []
    for seed in range(8 if name == "hierarchical" else 3):
        delays = random.Random(seed)
        run = Run(Author(seed=4), MEDIUM, shelf=Shelf(delays=delays), delays=delays)
        result = await run(name)
        seen.append((result, run.notes.events, run.notes.machines))
    assert all(item == seen[0] for item in seen)
    assert len(seen[0][1]) > 60


@pytest.mark.slow
@pytest.mark.parametrize("name", ASKING)
async def test_a_spent_budget_ends_cleanly_wherever_it_runs_out(name: str) -> None:
    """With more to spend a run only gets further: what was asked before is asked again."""
    whole = Run(Author(seed=5), MEDIUM)
    await whole(name)
    for budget in [*range(1, len(whole.labels), 5), len(whole.labels) - 1]:
        run = Run(Author(seed=5), MEDIUM, budget=budget)
        result = await run(name)
        assert result.stopped == "budget"
        assert len(run.labels) == budget
        assert set(run.labels) <= set(whole.labels)
        scores = [c.score for s in result.stages for c in s.survivors if c.score is not None]
        assert (result.best.score if result.best else None) == max(scores, default=None)
        if result.best is None:
            assert result.reason.startswith("no valid machine: ")
    enough = Run(Author(seed=5), MEDIUM, budget=len(whole.labels))
    assert (await enough(name)).stopped is None


@pytest.mark.parametrize("name", ASKING)
async def test_a_dead_endpoint_ends_the_run_with_its_error(name: str) -> None:
    author, left = Author(seed=5), [15]

    def replies(request):  # type: ignore[no-untyped-def]
        left[0] -= 1
        if left[0] < 0:
            raise UnreachableError("nothing answers")
        return author(request)

    run = Run(replies, MEDIUM, delays=random.Random(1))
    with pytest.raises(UnreachableError, match="nothing answers"):
        await run(name)


async def test_single_revises_at_the_designers_desk() -> None:
    run = Run(Author(seed=5, refused=0.0), MEDIUM)
    await run("single")
    assert set(run.model_roles) == {"designer"}
    assert {request.role for request in run.client.requests} == {"designer", "refiner"}
    assert {len(node["path"]) for node in run.notes.of("select").values()} == {1, 2, 3}


async def test_no_rounds_leave_the_loop_out() -> None:
    for name, stages in (("single", 1), ("iterative", 2)):
        run = Run(Author(refused=0.0), {"trajectories": 2, "search": {"rounds": 0}})
        assert len((await run(name)).stages) == stages


async def test_a_stage_counts_no_rollouts_of_earlier_ones() -> None:
    """The second trajectory is refined to the machine that the first one began with."""
    replies = {
        "designer/traj-1/attempt-1": fenced(steps((2, 0, 2), (1, 0, 0))),
        "designer/traj-2/attempt-1": fenced(steps((2, 0, 2))),
        "refiner/blind/traj-1/attempt-1": edit("Add 1 to 0 in 1"),
        "refiner/blind/traj-2/attempt-1": edit("Add 1 to 0 in 0"),
    }
    settings = {"trajectories": 2, "inspector": False, "search": {"rounds": 0}}
    run = Run(Script(replies), settings)
    result = await run("iterative")
    assert [stage.rollouts for stage in result.stages] == [2, 1]
    assert [len(stage.survivors) for stage in result.stages] == [2, 2]


async def test_one_querier_per_node() -> None:
    """Best-of-N expands a node again when nothing improves: the answers it had are told again."""
    run = Run(
        Author(seed=3, refused=0.0),
        {
            "trajectories": 1,
            "search": {"strategy": "best_of_n", "rounds": 4, "width": 2, "request_rounds": 1},
        },
        shelf=Shelf(lambda found: -float(len(found))),
    )
    await run("iterative")
    assert [label for label in run.labels if label.startswith("querier")] == [
        "querier/traj-1/node-0/attempt-1"
    ]
    assert [event["path"] for event in run.notes.of("select").values()] == [[0]] * 4
    last = next(r for r in run.client.requests if "/round-4/" in r.label)
    assert "1 tables." in last.messages[1].text


async def test_a_node_fallen_back_to_knows_what_was_refused() -> None:
    """Round 1 is refused, so node 1 is the same machine again: asked anew, told the refusal."""
    replies = {
        "designer/traj-1/attempt-1": fenced(steps((2, 0, 2))),
        "inspector/traj-1/attempt-1": CRITIQUE,
        "refiner/blind/traj-1/attempt-1": edit("Add 1 to 0 in 0"),
        "querier/traj-1/node-0/attempt-1": INQUIRY,
        "refiner/feedback/traj-1/round-1/node-0/try-1/attempt-1": edit("Remove 9"),
        "querier/traj-1/node-1/attempt-1": INQUIRY,
        "refiner/feedback/traj-1/round-2/node-1/try-1/attempt-1": edit("Add 1 to 0 in 1"),
    }
    settings = {"trajectories": 1, "search": {"rounds": 2, "width": 1, "request_rounds": 1}}
    run = Run(Script(replies), settings, shelf=Shelf(lambda found: float(len(found))))
    result = await run("iterative")
    assert run.labels == list(replies)
    assert (result.best and result.best.score, len(run.shelf.tried)) == (4.0, 3)
    told = run.prompt("refiner/feedback/traj-1/round-2/node-1/try-1/attempt-1")
    history = told.partition("## Edit history")[2].partition("## Simulation feedback")[0]
    assert "1. Success, score 2.00 -> 3.00" in history
    assert "2. Error, score 3.00 -> none" in history
    assert "Remove 9: Error (block_not_found" in history


async def test_a_node_expanded_again_knows_what_became_of_its_children() -> None:
    """Both children are worse than the best so far: the next round is told their scores, the
    second wave of the first round that the first reply was accepted and the second was not."""
    refiner = "refiner/feedback/traj-1"
    replies = {
        "designer/traj-1/attempt-1": fenced(steps((2, 0, 2))),
        "inspector/traj-1/attempt-1": CRITIQUE,
        "refiner/blind/traj-1/attempt-1": edit("Add 1 to 0 in 0"),
        "querier/traj-1/node-0/attempt-1": INQUIRY,
        f"{refiner}/round-1/node-0/try-1/attempt-1": edit("Add 1 to 0 in 1"),
        f"{refiner}/round-1/node-0/try-2/attempt-1": edit("Remove 9"),
        f"{refiner}/round-1/node-0/try-3/attempt-1": edit("Add 1 to 0 in 3"),
        f"{refiner}/round-2/node-0/try-1/attempt-1": edit("Add 1 to 0 in 4"),
        f"{refiner}/round-2/node-0/try-2/attempt-1": edit("Add 1 to 0 in 5"),
    }
    search = {"strategy": "best_of_n", "rounds": 2, "width": 2, "request_rounds": 2}
    shelf = Shelf(lambda found: -float(len(found)))
    run = Run(Script(replies), {"trajectories": 1, "search": search}, shelf=shelf)
    await run("iterative")
    assert run.labels == list(replies)
    second = run.prompt(f"{refiner}/round-1/node-0/try-3/attempt-1")
    earlier = second.partition("## Earlier attempts")[2].partition("## Your reply")[0]
    assert "1.\n> Add 1 to 0 in 1\n> (accepted: make a different change)\n" in earlier
    assert "2.\n> The script failed" in earlier
    history = run.prompt(f"{refiner}/round-2/node-0/try-1/attempt-1").partition("## Edit history")[
        2
    ]
    assert re.findall(r"^> (\d\..*)", history, re.MULTILINE) == [
        "1. Success, score -2.00 -> -3.00, best so far",
        "2. Success, score -3.00 -> -4.00, worst so far",
        "3. Error, score -3.00 -> none",
        "4. Success, score -3.00 -> -4.00",
    ]


async def test_histories_are_told_in_the_numbering_of_the_refined_machine() -> None:
    refiner = "refiner/feedback/traj-1"
    replies = {
        f"{refiner}/round-1/node-0/try-1/attempt-1": edit("Remove 1\nAdd 1 to 2 in 0 as a"),
        f"{refiner}/round-2/node-1/try-1/attempt-1": edit("Add 1 to 1 in 1"),
        f"{refiner}/round-3/node-2/try-1/attempt-1": fenced_edit(machine((1, 0, 1), (2, 0, 2))),
        f"{refiner}/round-4/node-3/try-1/attempt-1": edit(""),
        f"{refiner}/round-5/node-4/try-1/attempt-1": edit("Add 1 to 0 in 4"),
    }
    start = machine((1, 0, 0), (1, 0, 1), (2, 0, 2)).to_json()
    search = {"strategy": "random", "rounds": 5}
    settings = {"trajectories": 1, "search": search, "start": start, "querier": False}
    run = Run(Script(replies), settings, shelf=Shelf(lambda found: float(len(found))))
    await run("iterative")
    told = [
        re.sub(r"(?m)^> ?", "", prompt.partition("## Edit history\n")[2].partition("\n\n")[0])
        for prompt in map(run.prompt, list(replies)[1:])
    ]
    assert told[0] == (
        "1. Success, score 4.00 -> 4.00\n"
        "   Remove Wooden Block (gone from 0 in 0)\n"
        "   Add 1 to 1 in 0 as 3"
    )
    assert told[1].endswith("2. Success, score 4.00 -> 5.00, best so far\n   Add 1 to 1 in 1")
    assert told[2] == (
        "1. Success, score 4.00 -> 4.00\n"
        "   Remove Wooden Block (gone from 0 in 0)\n"
        "   Add 1 to 1 in 0 as Wooden Block (gone from 1 in 0)\n"
        "2. Success, score 4.00 -> 5.00, best so far\n"
        "   Add 1 to 1 in 1\n"
        "3. Success, score 5.00 -> 3.00, worst so far\n"
        "   a new machine: d"
    )
    assert told[3].endswith("4. Success, score 3.00 -> 3.00\n   no change")


def fenced_edit(found: Machine) -> str:
    return edit(f"```json\n{found.to_text()}\n```")


async def test_no_valid_initial_machine_is_a_result() -> None:
    for name in ("iterative", "single"):
        run = Run(Author(refused=1.0), {"trajectories": 2})
        result = await run(name)
        assert (result.best, result.stopped, len(result.stages)) == (None, None, 1)
        assert result.reason.startswith("no valid machine: The reply contains no valid machine:")


async def test_a_budget_spent_on_the_first_machines_begins_no_later_stage() -> None:
    run = Run(Author(refused=0.0), {"trajectories": 2}, budget=1)
    result = await run("iterative")
    assert [(stage.name, len(stage.survivors)) for stage in result.stages] == [("initial", 1)]
    assert (result.stopped, result.best_stage) == ("budget", "initial")
    reasons = [candidate.reason for candidate in result.stages[0].candidates]
    assert reasons == ["", "the budget ran out before an answer"]


@pytest.mark.parametrize("strategy", ["halving", "ab-mcts"])
async def test_edits_use_the_simulations_that_no_call_is_left_for(strategy: str) -> None:
    settings = {"trajectories": 2, "max_simulations": 12, "search": {"strategy": strategy}}
    run = Run(Author(refused=0.0), settings, budget=5)
    await run("iterative")
    assert len(run.labels) == 5
    simulated = {data["machine"] for data in run.notes.of("evaluation").values()}
    assert len(simulated) == 12


async def test_calls_that_are_used_up_before_the_first_design_are_told() -> None:
    run = Run(Author(refused=0.0), {"search": {"strategy": "halving"}}, budget=1)
    result = await run("hierarchical")  # the meta-designer takes the call
    assert (result.best, result.stopped) == (None, "budget")
    assert result.reason.startswith("no valid machine: ")
    assert result.reason.endswith("the budget ran out before an answer")


async def test_what_the_simulation_refuses_is_told() -> None:
    class Refusing(Shelf):
        async def evaluate(self, found: Machine, label: str) -> Evaluation:
            return replace(await super().evaluate(found, label), valid=False)

    run = Run(Author(refused=0.0), {"trajectories": 1}, shelf=Refusing())
    result = await run("iterative")
    assert result.reason == "no valid machine: the simulation refused the machine"


async def test_refinements_that_are_all_refused_leave_the_first_machines() -> None:
    """Blind refinements refused: the run ends there. In the loop: every tree is its root."""

    def replies(request):  # type: ignore[no-untyped-def]
        return Author(refused=float(request.role == "refiner"))(request)

    run = Run(
        replies, {"trajectories": 2, "search": {"rounds": 2, "width": 2, "request_rounds": 2}}
    )
    result = await run("iterative")
    assert [len(stage.survivors) for stage in result.stages] == [2, 0]
    assert result.best_stage == "initial"
    run = Run(
        replies, {"trajectories": 2, "search": {"rounds": 2, "width": 2, "request_rounds": 2}}
    )
    result = await run("single")
    assert result.best_stage == "initial"
    assert [event["fallback"] for event in run.notes.of("expand").values()] == [True] * 4
    assert [event["valid"] for event in run.notes.of("search").values()] == [0, 0]


async def test_a_refusal_loop_is_visible_and_ends() -> None:
    """The same invalid edit again and again: every attempt recorded with its code, then an end."""

    def replies(request):  # type: ignore[no-untyped-def]
        if request.role == "refiner":
            return edit("Remove 99")
        return Author(refused=0.0)(request)

    run = Run(
        replies, {"trajectories": 1, "search": {"rounds": 2, "width": 2, "request_rounds": 3}}
    )
    await run("iterative")
    blind = [label for label in run.labels if "refiner/blind" in label]
    assert len(blind) == run.max_retry
    run = Run(
        replies, {"trajectories": 1, "search": {"rounds": 2, "width": 2, "request_rounds": 3}}
    )
    await run("single")
    codes = [
        event["code"] for event in run.notes.of("attempt").values() if event["role"] == "refiner"
    ]
    assert codes == ["block_not_found"] * 6
    told = run.prompt("refiner/feedback/traj-1/round-1/node-0/try-3/attempt-1")
    assert told.count("Remove 99: Error (block_not_found") == 2


def machines_of(run: Run) -> int:
    return len(set(run.shelf.tried))


@pytest.mark.parametrize("strategy", STRATEGIES)
@pytest.mark.parametrize(("name", "most"), [("iterative", 1), *((name, 7) for name in SEARCHING)])
async def test_no_run_simulates_more_than_its_limit(name: str, strategy: str, most: int) -> None:
    settings = {**MEDIUM, "max_simulations": most}
    settings["search"] = {**MEDIUM["search"], "strategy": strategy}  # type: ignore[dict-item]
    run = Run(Author(seed=5), settings)
    result = await run(name)
    assert 1 <= machines_of(run) <= most
    assert result.best is not None


@pytest.mark.parametrize("strategy", [name for name in STRATEGIES if deals_budget(name)])
@pytest.mark.parametrize("name", SEARCHING)
async def test_a_search_over_the_whole_run_uses_all_simulations(name: str, strategy: str) -> None:
    settings = {**MEDIUM, "max_simulations": 30}
    settings["search"] = {**MEDIUM["search"], "strategy": strategy}  # type: ignore[dict-item]
    run = Run(Author(seed=5), settings)
    result = await run(name)
    initial, refined = result.stages
    assert initial.rollouts + refined.rollouts == machines_of(run)
    made = {maker.maker: maker for maker in result.makers}
    assert set(made) == {"designer"} | set(run.settings.arms)
    assert made["designer"].machines == sum(c.valid for c in initial.candidates)
    assert sum(maker.share for maker in made.values()) == pytest.approx(1)
    assert all(0 <= maker.better <= maker.machines for maker in made.values())
    assert result.best is not None
    assert result.best.score is not None
    first = next(c.score for c in initial.candidates if c.score is not None)
    assert 0 <= result.best.score - first <= sum(maker.gain for maker in made.values()) + 1e-9
    assert len(initial.candidates) == len(refined.candidates)
    if strategy == "independent":  # the author of these tests has few different designs
        assert refined.rollouts == 0
        assert len(initial.candidates) > 30
    else:
        assert refined.rollouts > 0
        assert machines_of(run) == 30


@pytest.mark.parametrize("strategy", ["ab-mcts", "halving"])
@pytest.mark.parametrize("name", SEARCHING)
async def test_a_search_over_the_whole_run_does_not_depend_on_the_order_of_answers(
    name: str, strategy: str
) -> None:
    """The same prompts under the same labels: several nodes of a trajectory grow at once."""
    settings: dict[str, Any] = {**MEDIUM, "trajectories": 6, "max_simulations": 40}
    settings |= {"emitters": ["refiner"], "search": {**MEDIUM["search"], "strategy": strategy}}  # type: ignore[dict-item]
    seen = []
    for seed in range(4):
        delays = random.Random(seed)
        run = Run(Author(seed=4), settings, shelf=Shelf(delays=delays), delays=delays)
        result = await run(name)
        prompts = {request.label: request.messages for request in run.client.requests}
        seen.append((result, run.notes.events, prompts))
    assert all(item == seen[0] for item in seen)
    rounds = Counter(label.rpartition("/node")[0] for kind, label in seen[0][1] if kind == "select")
    if strategy == "ab-mcts":
        assert max(rounds.values()) > 1, "no round has expanded two nodes of a trajectory"


class Undoing(Author):
    """A refiner that takes away the last block."""

    def refiner(self, prompt: str, _chance: random.Random) -> str:
        return edit(f"Remove {len(machine_in(prompt)) - 1}")


def longer(found: Machine, rng: random.Random, brief: Brief) -> tuple[str, Machine]:
    """An edit that adds a block at the end."""
    while True:
        kind, made = local_edit(found, rng, brief)
        if made.steps[:-1] == found.steps:
            return kind, made


@pytest.mark.slow
async def test_an_edit_may_lead_back_to_the_first_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is known without being simulated, also to the refiner that is asked next."""
    monkeypatch.setattr(stages_pooled, "local_edit", longer)
    settings: dict[str, Any] = {"trajectories": 1, "max_simulations": 30}
    settings |= {"emitters": ["edit", "refiner"], "search": {"strategy": "half-and-half"}}
    for seed in range(6):
        shelf = Shelf(lambda found: float(min(len(found), 4)))
        result = await Run(Undoing(refused=0.0), settings, shelf=shelf, seed=seed)("iterative")
        assert result.best is not None


async def test_each_node_is_refined_with_its_own_history() -> None:
    """Although other nodes of its trajectory are refined in the same round."""
    settings: dict[str, Any] = {**MEDIUM, "trajectories": 6, "max_simulations": 120}
    settings |= {"emitters": ["refiner"], "search": {**MEDIUM["search"], "strategy": "ab-mcts"}}  # type: ignore[dict-item]
    run = Run(Author(seed=4), settings, delays=random.Random(0))
    await run("iterative")
    scripts = {label: data.get("script", "") for label, data in run.notes.of("attempt").items()}
    checked = 0
    for label in run.labels:
        found = re.fullmatch(r"refiner/feedback/(traj-\d+)/round-\d+/(node-[1-9]\d*)/.*", label)
        if found:
            made = run.notes.of("node")[f"env_feedback/{found[1]}/{found[2]}"]["made_by"]
            script = scripts[f"refiner/feedback/{found[1]}/{made}/attempt-1"]
            assert script in run.prompt(label)
            checked += 1
    assert checked > 5
