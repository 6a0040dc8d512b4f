"""Trials of a task: between them only the controls may be revised, and the best one counts."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from agentflow.machine.brief import Limits
from agentflow.machine.tree import Control, Machine
from agentflow.report.lineage import Lineage
from agentflow.runs.events import typed_event
from agentflow.runs.reading import Event
from agentflow.workflows.registry import WORKFLOWS
from agentflow.workflows.settings import WorkflowSettings
from tests.workflows.fakes import BRIEF, Run, Script, Shelf, edit, fenced, machine, steps

TRIED = replace(BRIEF, limits=Limits(controls=5.0, trials=3))
CART = machine((1, 0, 0), (2, 0, 2))
DESIGN = fenced({"blocks": steps((1, 0, 0), (2, 0, 2)), "controls": []})
ONCE = {"trajectories": 1, "search": {"rounds": 0}}


def by_level(found: Machine) -> float:
    """The score is the level of the last entry."""
    return found.controls[-1].level if found.controls else 0.1


def run(second: str, third: str, **options: Any) -> Run:
    replies = {
        "designer/traj-1/attempt-1": DESIGN,
        "refiner/initial/traj-1/try-1/attempt-1": edit(second),
        "refiner/initial/traj-1/try-2/attempt-1": edit(third),
        "refiner/initial/traj-1/try-2/attempt-2": edit("Uncontrol 0"),
    }
    return Run(Script(replies), ONCE, shelf=Shelf(by_level), brief=TRIED, **options)


def levels(*numbers: float) -> tuple[Control, ...]:
    return tuple(Control("motors", 0.0, 1.0, number) for number in numbers)


def command(level: float) -> str:
    return f"Control motors at 0 for 1 level {level}"


async def test_the_best_trial_counts() -> None:
    tried = run(command(0.8), command(0.5))
    result = await tried("single")
    assert result.best is not None
    assert (result.best.score, result.best.machine) == (0.8, replace(CART, controls=levels(0.8)))
    assert [stage.rollouts for stage in result.stages] == [3]
    assert list(tried.notes.of("evaluation")) == [
        "initial/traj-1",
        "initial/traj-1/try-1",
        "initial/traj-1/try-2",
    ]


async def test_each_revision_sees_the_best_trial_and_what_was_tried() -> None:
    tried = run(command(-0.5), command(0.5))
    result = await tried("single")
    assert result.best is not None
    assert result.best.machine == replace(CART, controls=levels(0.5))
    first, second = (
        tried.prompt(f"refiner/initial/traj-1/try-{number}/attempt-1") for number in (1, 2)
    )
    assert "The machine has had 1 of its 3 trials" in first
    assert "This is for trial 2." in first
    assert "Rolled 0.1 m." in first
    assert "This is for trial 3." in second
    assert "score 0.10 -> -0.50" in second


async def test_blocks_may_not_change_between_trials() -> None:
    tried = run(command(0.8), "Add 1 to 0 in 1")
    result = await tried("single")
    refused = tried.notes.of("attempt")["refiner/initial/traj-1/try-2/attempt-1"]
    assert refused["code"] == "blocks_altered"
    assert "use only the commands Control, Uncontrol and Set" in refused["problem"]
    assert result.best is not None
    assert result.best.score == 0.8


async def test_an_empty_revision_ends_the_trials() -> None:
    result = await run("", command(1.0))("single")
    assert [(stage.rollouts, stage.calls) for stage in result.stages] == [(1, 2)]


async def test_a_budget_ends_the_trials() -> None:
    result = await run(command(0.8), command(1.0), budget=2)("single")
    assert result.stopped == "budget"
    assert result.best is not None
    assert result.best.score == 0.8


def test_expected_calls_and_simulations_include_trials() -> None:
    settings = WorkflowSettings.model_validate({**ONCE, "trajectories": 2})
    for name, machines in (("single", 2), ("iterative", 4), ("hierarchical", 4), ("random-dsl", 0)):
        workflow = WORKFLOWS[name]
        assert workflow.retries(settings, TRIED) == 2 * machines
        assert workflow.retries(settings, BRIEF) == 0
        refined = workflow.calls(settings).get("refiner", 0)
        assert workflow.calls_on(settings, TRIED).get("refiner", 0) == refined + 2 * machines


async def test_tasks_without_trials_ask_nobody() -> None:
    plain = Run(Script({"designer/traj-1/attempt-1": DESIGN}), ONCE, brief=BRIEF)
    assert (await plain("single")).stages[0].rollouts == 1


async def test_reports_show_trials_as_children_of_the_best_one_before() -> None:
    tried = run(command(0.8), command(0.5))
    await tried("single")
    events = (
        typed_event(Event(kind, label, data)) for (kind, label), data in tried.notes.events.items()
    )
    nodes = {node.id: node for node in Lineage.of(events).finish(None)}
    assert [(node.parent, node.title, node.score) for node in nodes.values()] == [
        (None, "first design 1", 0.1),
        ("initial/traj-1", "first design 1, trial 2", 0.8),
        ("initial/traj-1/try-1", "first design 1, trial 3", 0.5),
    ]
    assert nodes["initial/traj-1/try-1"].edit == command(0.8)
