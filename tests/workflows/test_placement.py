"""Placement: independent attempts, counted; which tasks take it."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from typing import Any

import pytest

from agentflow.agents.base import AskContext
from agentflow.agents.registry import scripts
from agentflow.env.tasks.registry import get_task
from agentflow.errors import UsageError
from agentflow.llm.messages import Reply, Request
from agentflow.llm.procedural import ProceduralClient
from agentflow.machine.geometry.gears import gear_trains, meshing_pairs
from agentflow.machine.geometry.placement import place
from agentflow.machine.tree import Machine, Step
from agentflow.prompts.render import PromptSet
from agentflow.runs.events import RunEvent
from agentflow.search.node import Evaluation
from agentflow.tools.host import SimulationSummary
from agentflow.workflows.base import (
    Candidate,
    FirstAttempt,
    Stage,
    WorkflowResult,
    count_passes,
)
from agentflow.workflows.registry import WORKFLOWS, check_fit
from agentflow.workflows.settings import WorkflowSettings
from tests.scripted import ScriptedClient

TASK = get_task("gearing")
BRIEF = TASK.brief
MIDDLE = TASK.parameters.base.face(0.0, 0.0)  # type: ignore[attr-defined]
SOLVED = Machine((*BRIEF.given, Step(3, 38, 0, MIDDLE)))
CLASHING = Machine((*SOLVED, Step(4, 38, 0, MIDDLE + 1)))


class Teeth:
    """An evaluator that knows ideal teeth and no forces."""

    def __init__(self) -> None:
        self.tried: list[str] = []

    async def evaluate(self, machine: Machine, label: str) -> Evaluation:
        self.tried.append(label)
        found = gear_trains(
            [step.id for step in machine][1:], meshing_pairs(place(machine).blocks, 0.1)
        )
        score = float(found[0].speeds.get(2, 0.0) > 0)
        return Evaluation(True, score, SimulationSummary(score, "ok", f"Score: {score:.2f}"))

    async def query(self, machine: Machine, queries: Sequence[object]) -> str:  # noqa: ARG002
        raise AssertionError("nobody asks")

    async def views(self, machine: Machine) -> tuple[str, ...]:  # noqa: ARG002
        raise AssertionError("nobody looks")


class Notes:
    """A record in memory."""

    def __init__(self) -> None:
        self.events: list[tuple[str, str]] = []

    def event(self, event: RunEvent) -> None:
        self.events.append((event.kind, event.label))

    def save_machine(self, digest: str, text: str) -> None:
        """Not looked at."""


def run(
    client: Any, count: int, record: Notes | None = None, start: Machine | None = None
) -> WorkflowResult:
    def context(role: str) -> AskContext:
        assert role == "designer"
        return AskContext(client, PromptSet())

    tree = start.to_json() if start else ()
    settings = WorkflowSettings(placements=count, start=tuple(tree))
    return asyncio.run(
        WORKFLOWS["placement"](BRIEF, context, Teeth(), settings, record or Notes(), seed=1)
    )


def reply(machine: Machine) -> str:
    return f"A row.\n```json\n{machine.to_text()}\n```"


def test_every_attempt_is_one_call_and_is_judged_by_itself() -> None:
    answers = {
        "placer/traj-1/attempt-1": reply(SOLVED),
        "placer/traj-2/attempt-1": reply(CLASHING),
        "placer/traj-3/attempt-1": "I cannot.",
        "placer/traj-4/attempt-1": reply(BRIEF.given),
    }

    def answer(request: Request) -> Reply:
        assert "face n is at x = -4 + 0.5 * (n mod 17)" in request.messages[1].text
        return Reply(text=answers[request.label], model="scripted")

    record = Notes()
    result = run(ScriptedClient(answer), 4, record)
    (stage,) = result.stages
    assert [c.score for c in stage.candidates] == [1.0, None, None, 0.0]
    assert count_passes(stage) == {
        "attempts": 4,
        "parsed": 3,
        "spatial": 2,
        "passes": 1,
        "share": 0.25,
    }
    assert stage.candidates[1].reason.startswith(
        "The machine is not valid:\n- block 4 (Medium Cog)"
    )
    assert result.best is not None
    assert result.best.machine == SOLVED
    assert [label for kind, label in record.events if kind == "attempt"] == list(answers)


def test_placements_are_added_to_a_start_machine() -> None:
    longer = Machine((*SOLVED, Step(4, 38, 0, MIDDLE + 6)))
    answers = [reply(longer), reply(BRIEF.given)]

    def answer(request: Request) -> Reply:
        assert SOLVED.to_text() in request.messages[1].text
        return Reply(text=answers[int(request.label[12]) - 1], model="scripted")

    stage = run(ScriptedClient(answer), 2, start=SOLVED).stages[0]
    assert [c.machine for c in stage.candidates] == [longer, None]
    assert "block 3 is given and must be repeated" in stage.candidates[1].reason


def test_the_procedural_model_finds_the_shortest_path_every_time() -> None:
    result = run(ProceduralClient(3, scripts()), 8)
    assert count_passes(result.stages[0])["passes"] == 8
    assert run(ProceduralClient(3, scripts()), 8) == result


def test_random_placements_are_valid_and_differ() -> None:
    def nobody(role: str) -> AskContext:
        raise AssertionError(role)

    settings = WorkflowSettings(placements=12)
    work = WORKFLOWS["random-placement"](BRIEF, nobody, Teeth(), settings, Notes(), seed=1)
    (stage,) = asyncio.run(work).stages
    machines = {c.machine for c in stage.candidates}
    assert len(machines) == 12
    assert all(m is not None and m.steps[:3] == BRIEF.given.steps for m in machines)
    assert all(1 <= len(m) - 3 <= 10 for m in machines if m)
    assert (stage.calls, stage.tokens) == (0, 0)


def test_attempts_that_the_computer_could_not_score_do_not_count() -> None:
    crashed = Evaluation(True, None, SimulationSummary(None, "crashed", ""))
    lost = Candidate(1, SOLVED, crashed, FirstAttempt(True, True, True))
    assert count_passes(Stage("initial", (lost,), 1, 0, 1)) == {
        "attempts": 0,
        "parsed": 0,
        "spatial": 0,
        "passes": 0,
        "share": None,
    }


def test_only_what_fits_is_accepted() -> None:
    check_fit("placement", BRIEF)
    check_fit("iterative", get_task("throwing").brief)
    with pytest.raises(UsageError) as caught:
        check_fit("hierarchical", BRIEF)
    assert str(caught.value) == (
        "the workflow hierarchical does not fit gearing; choose from: placement, random-placement"
    )
    with pytest.raises(UsageError, match=r"^the workflow random-placement does not fit throwing; "):
        check_fit("random-placement", get_task("throwing").brief)
