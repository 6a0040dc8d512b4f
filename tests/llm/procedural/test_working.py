"""Work with tools: it designs, measures, edits and submits within the budget of a real bench."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agentflow.agents.registry import scripts
from agentflow.env.tasks.registry import FAMILIES
from agentflow.llm.messages import Message, Request, Tool, ToolCall
from agentflow.llm.procedural import ProceduralClient
from agentflow.runs.events import ToolEvent
from agentflow.runs.locations import BLIND, INITIAL
from agentflow.tools.bench import TOOLS, Bench
from tests.tools.benches import CAR, open_bench


async def work(bench: Bench, seed: int = 0) -> list[str]:
    """Let the procedural model work until it stops; the names of the tools that it called."""
    tools = tuple(Tool(**vars(spec)) for spec in bench.tools)
    told = await bench.call("brief", None)
    messages, called = [Message(role="user", text=told.text)], list[str]()
    while not bench.ended:
        label = f"agent/attempt-{len(messages)}"
        request = Request(role="agent", label=label, messages=tuple(messages), tools=tools)
        reply = await ProceduralClient(seed, scripts()).complete(request)
        if not reply.tool_calls:
            assert (reply.text, reply.finish) == ("There is nothing left for me to do.", "stop")
            break
        assert (reply.text, reply.finish) == ("", "tool_calls")
        messages.append(reply.message)
        for call in reply.tool_calls:
            called.append(call.name)
            result = await bench.call(call.name, call.arguments)
            messages.append(Message(role="tool", text=result.text, tool_call_id=call.id))
    return called


@pytest.mark.slow
async def test_it_simulates_designs_and_their_edits_and_submits_the_best() -> None:
    async with open_bench(submissions=2, rollouts=4) as (bench, record):
        called = await work(bench)
        scores = {
            event["machine"]: float(event["answer"].partition("score ")[2].split()[0].rstrip("."))
            for (kind, _), event in record.events.items()
            if kind == ToolEvent.kind and event["tool"] == "simulate"
        }
        best = sorted(scores.values(), reverse=True)[:2]
        assert [scores[machine.digest] for machine in bench.submitted] == best
    assert (len(scores), called[-2:]) == (4, ["submit", "submit"])
    assert called[:3] == ["history", "check", "check"]
    assert called.count("edit") >= 2
    assert best[0] > 40


async def test_without_simulations_it_submits_what_it_checks() -> None:
    async with open_bench(stage=INITIAL, submissions=3, rollouts=None) as (bench, _):
        called = await work(bench)
        assert len(set(bench.submitted)) == 3
    assert set(called) == {"check", "submit"}


@pytest.mark.parametrize("family", [name for name in FAMILIES if name != "gearing"])
async def test_it_has_valid_machines_for_every_family(family: str) -> None:
    async with open_bench(family, INITIAL, submissions=1, rollouts=None) as (bench, _):
        await work(bench)
        assert len(bench.submitted) == 1


async def test_without_simulations_it_edits_machines_of_earlier_stages() -> None:
    async with open_bench(stage=BLIND, submissions=2, rollouts=None) as (bench, _):
        car = (await bench.call("check", {"machine": CAR})).data["machine"]
        assert await work(bench) == ["describe", "edit", "edit", "submit", "submit"]
        parents = [known.parent for known in bench.machines if known.machine in bench.submitted]
    assert parents == [car, car]


async def test_equal_seeds_give_equal_machines() -> None:
    found = []
    for seed in (1, 1, 2):
        async with open_bench(stage=INITIAL, submissions=2, rollouts=None) as (bench, _):
            await work(bench, seed)
            found.append(bench.submitted)
    assert found[0] == found[1] != found[2]


async def test_it_submits_when_all_simulations_are_used() -> None:
    async with open_bench(submissions=1, rollouts=0) as (bench, _):
        await bench.call("check", {"machine": CAR})
        assert await work(bench) == ["history"]
        assert bench.submitted == ()


TEXT = st.text(max_size=20) | st.sampled_from(
    [
        "Machine 0123abcd: valid, 3 blocks.",
        "Machine 0123abcd: score 3.25.",
        "9 of 9 submissions left, 9 of 9 simulations left",
        "0123abcd | 3 | - | - | 3.25 | -",
        '{"machine": "0123abcd", "script": "Remove 1"}',
        '{"machine": 3}',
        CAR,
    ]
)
CALLED = st.tuples(st.sampled_from([tool.spec.name for tool in TOOLS]) | TEXT, TEXT, TEXT)


@settings(deadline=None, max_examples=60)
@given(st.text(max_size=30), st.lists(CALLED, max_size=5), st.booleans())
async def test_any_conversation_gets_a_reply(
    question: str, calls: list[tuple[str, str, str]], measures: bool
) -> None:
    messages = [Message(role="user", text=question)]
    for number, (name, arguments, answer) in enumerate(calls):
        call = ToolCall(id=str(number), name=name, arguments=arguments)
        messages.append(Message(role="assistant", text="", tool_calls=(call,)))
        messages.append(Message(role="tool", text=answer, tool_call_id=str(number)))
    tools = [Tool(**vars(tool.spec)) for tool in TOOLS if measures or tool.spec.name != "simulate"]
    request = Request(role="agent", label="a", messages=tuple(messages), tools=tuple(tools))
    first, second = [await ProceduralClient(0, scripts()).complete(request) for _ in range(2)]
    assert first == second
    assert {call.name for call in first.tool_calls} <= {tool.spec.name for tool in TOOLS}
