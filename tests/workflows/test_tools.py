"""The workflow `tools`: stages and budgets, how conversations end, what goes back to the model."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import replace

import pytest

from agentflow.llm.messages import Reply, Request, ToolCall
from agentflow.workflows.tools import MOST_CALLS, MOST_REFUSED
from tests.workflows.fakes import BRIEF, Author, Run, machine, steps

CART = json.dumps(steps((1, 0, 0), (2, 0, 2)))
NAME = machine((1, 0, 0), (2, 0, 2)).digest[:8]
Calls = tuple[tuple[str, Mapping[str, object]], ...]


def saying(answer: Callable[[int, str], Calls]) -> Callable[[Request], Reply]:
    """Replies with the tool calls that a function gives for a turn (1, 2, ...) of a stage."""

    def reply(request: Request) -> Reply:
        _, stage, turn = request.label.split("/")
        calls = answer(int(turn.removeprefix("attempt-")), stage)
        made = tuple(
            ToolCall(id=f"call-{number}", name=name, arguments=json.dumps(arguments))
            for number, (name, arguments) in enumerate(calls)
        )
        return Reply(text="" if made else "I am done.", tool_calls=made)

    return reply


def submit_cart(turn: int, _stage: str) -> Calls:
    calls = ("check", {"machine": CART}), ("submit", {"machine": NAME})
    return calls if turn == 1 else ()


async def test_stages_share_machines_and_leave_simulations_for_the_last() -> None:
    run = Run(Author(seed=5, refused=0.0), {"max_simulations": 7, "candidates_per_stage": 4})
    result = await run("tools")
    assert [len(stage.candidates) for stage in result.stages] == [4, 4, 4]
    submitted = [sum(c.machine is not None for c in stage.candidates) for stage in result.stages]
    assert submitted[0] == 2  # a third of 7
    assert len(run.shelf.tried) <= 7
    first, second = (
        run.prompt(f"agent/{stage}/attempt-1") for stage in ("initial", "env_feedback")
    )
    names = [c.machine.digest[:8] for c in result.stages[0].candidates if c.machine]
    assert "Machines so far" not in first
    assert "no simulation in this stage" in first
    line = next(line for line in second.splitlines() if line.startswith("Machines so far: "))
    assert all(name in line for name in names)
    offered = {r.label.split("/")[1]: {t.name for t in r.tools} for r in run.client.requests}
    more = {"simulate", "verify", "explore_edits", "query"}
    assert offered["env_feedback"] - offered["initial"] == more


async def test_scores_of_earlier_stages_are_known_only_with_simulation() -> None:
    told = {}

    def answer(turn: int, stage: str) -> Calls:
        return submit_cart(turn, stage) if turn == 1 else (("history", {}),) if turn == 2 else ()

    run = Run(saying(answer), {"candidates_per_stage": 2})
    await run("tools")
    for request in run.client.requests:
        if request.messages[-1].text.startswith("machine | blocks"):
            told[request.label.split("/")[1]] = request.messages[-1].text
    assert told["blind_refinement"].endswith("| not simulated | initial")
    score = f"{run.shelf.score(machine((1, 0, 0), (2, 0, 2))):.2f}"
    assert told["env_feedback"].endswith(f"| {score} | initial")


@pytest.mark.parametrize(
    ("answer", "reason", "calls"),
    [
        (lambda _t, _s: (), "2 replies in a row called no tool", 0),
        (
            lambda _t, _s: (("simulate", {"machine": "x"}),),
            f"{MOST_REFUSED} calls in a row were refused",
            MOST_REFUSED,
        ),
        (lambda _t, _s: (("history", {}),) * 7, f"{MOST_CALLS} calls were made", MOST_CALLS),
    ],
)
async def test_a_conversation_that_leads_nowhere_ends(
    answer: Callable[[int, str], Calls], reason: str, calls: int
) -> None:
    run = Run(saying(answer), {"candidates_per_stage": 2})
    result = await run("tools")
    assert result.best is None
    assert result.reason == f"no valid machine: submitted no machine: {reason}"
    assert [len(stage.candidates) for stage in result.stages] == [2, 2, 2]
    assert {c.reason for stage in result.stages for c in stage.candidates} == {
        f"submitted no machine: {reason}"
    }
    for stage in result.stages:
        assert sum(count["calls"] for count in stage.tools.values()) == calls


async def test_a_model_that_only_talks_is_told_once_what_is_left() -> None:
    run = Run(saying(lambda _t, _s: ()), {"candidates_per_stage": 2})
    await run("tools")
    last = run.client.requests[1].messages
    assert [message.role for message in last] == ["system", "user", "assistant", "user"]
    assert last[-1].text == (
        "The reply calls no tool. Stage initial: 2 of 2 submissions left, no simulation in this "
        "stage. Call a tool; `submit` takes your machines. To end this stage with what is "
        "submitted, reply without a tool call again."
    )


async def test_a_spent_budget_keeps_what_was_submitted() -> None:
    run = Run(saying(submit_cart), {"candidates_per_stage": 2}, budget=1)
    result = await run("tools")
    assert result.stopped == "budget"
    assert [c.machine is not None for c in result.stages[0].candidates] == [True, False]
    assert result.best is not None


async def test_pictures_go_back_to_the_model() -> None:
    def answer(turn: int, _stage: str) -> Calls:
        look = ("look", {"machine": NAME, "view": "top"})
        late = ("look", {"machine": NAME, "view": "top", "time": 1})
        return (("check", {"machine": CART}), look, late) if turn == 1 else ()

    run = Run(saying(answer), {"vision": True, "max_pictures": 1, "candidates_per_stage": 1})
    result = await run("tools")
    answers = run.client.requests[1].messages[-3:]
    assert [message.tool_call_id for message in answers] == ["call-0", "call-1", "call-2"]
    assert [len(message.images) for message in answers] == [0, 1, 0]
    assert answers[1].images[0].startswith("data:image/png;base64,")
    assert "1 of 1 pictures left" in answers[1].text
    assert answers[2].text.startswith("this stage has no simulation")
    assert result.stages[0].tools["look"] == {"calls": 2, "refused": 1}


async def test_the_greatest_possible_score_ends_the_run() -> None:
    run = Run(saying(submit_cart), {"candidates_per_stage": 2}, brief=replace(BRIEF, greatest=0.0))
    result = await run("tools")
    assert result.stopped == "greatest score"
    assert [stage.name for stage in result.stages] == ["initial"]


async def test_a_simulated_machine_counts_where_nothing_is_submitted() -> None:
    def answer(turn: int, stage: str) -> Calls:
        if stage == "env_feedback" and turn == 1:
            return ("check", {"machine": CART}), ("simulate", {"machine": NAME})
        return ()

    run = Run(saying(answer), {"candidates_per_stage": 2})
    result = await run("tools")
    assert [c.machine is not None for c in result.stages[-1].candidates] == [True, False]
    assert result.best is not None
    assert result.best_stage == "env_feedback"
    assert run.notes.of("tool")["env_feedback/call-2"]["tool"] == "simulate"


async def test_a_machine_of_an_earlier_stage_does_not_count_again() -> None:
    run = Run(
        saying(lambda turn, stage: submit_cart(turn, stage) if stage == "initial" else ()),
        {"candidates_per_stage": 2},
    )
    result = await run("tools")
    assert [sum(c.valid for c in stage.candidates) for stage in result.stages] == [1, 0, 0]
