"""Recording, resuming, replaying."""

from __future__ import annotations

import asyncio
import random
from pathlib import Path

import pytest

from agentflow.errors import BudgetSpentError, ReplayMissError
from agentflow.llm.messages import Message, Reply, Request
from agentflow.llm.wrappers.record import CallLog, RecordingClient, ReplayClient
from tests.llm.helpers import ask
from tests.scripted import ScriptedClient


def call_log_at(folder: Path, *, writable: bool = True) -> CallLog:
    return CallLog(folder / "calls.jsonl", pytest.fail, writable=writable)


def echo() -> ScriptedClient:
    return ScriptedClient(lambda request: f"to {request.label}: {request.messages[0].text}")


async def test_a_recorded_question_is_not_asked_again(tmp_path: Path) -> None:
    inner = ScriptedClient(["first", "second"])
    with call_log_at(tmp_path) as call_log:
        first = await RecordingClient(inner, call_log).complete(ask(label="a/1"))
    with call_log_at(tmp_path) as call_log:
        client = RecordingClient(inner, call_log)
        assert await client.complete(ask(label="a/1")) == first
        assert (await client.complete(ask(label="a/2"))).text == "second"
        await client.aclose()
    assert len(inner.requests) == 2


async def test_the_line_is_on_disk_before_the_reply_is_used(tmp_path: Path) -> None:
    with call_log_at(tmp_path) as call_log:
        await RecordingClient(echo(), call_log).complete(ask("hi", "a/1"))
        assert '"text":"to a/1: hi"' in (tmp_path / "calls.jsonl").read_text()


async def test_the_same_call_twice_at_once_is_one_call(tmp_path: Path) -> None:
    class Slow(ScriptedClient):
        async def complete(self, request: Request) -> Reply:
            await asyncio.sleep(0.01)
            return await super().complete(request)

    inner = Slow(["only"])
    with call_log_at(tmp_path) as call_log:
        client = RecordingClient(inner, call_log)
        replies = await asyncio.gather(*[client.complete(ask()) for _ in range(5)])
    assert {reply.text for reply in replies} == {"only"}
    assert len((tmp_path / "calls.jsonl").read_text().splitlines()) == 1


async def test_a_failed_call_is_not_recorded_and_may_be_asked_again(tmp_path: Path) -> None:
    def answer(_request: Request) -> str:
        if len(inner.requests) == 1:
            raise BudgetSpentError("x")
        return "ok"

    inner = ScriptedClient(answer)
    with call_log_at(tmp_path) as call_log:
        client = RecordingClient(inner, call_log)
        with pytest.raises(BudgetSpentError):
            await client.complete(ask())
        assert len(call_log) == 0
        assert (await client.complete(ask())).text == "ok"


async def test_order_of_completion_does_not_change_the_record(tmp_path: Path) -> None:
    class Shuffled(ScriptedClient):
        def __init__(self, rng: random.Random) -> None:
            super().__init__(lambda request: f"reply to {request.label}")
            self.rng = rng

        async def complete(self, request: Request) -> Reply:
            for _ in range(self.rng.randrange(20)):
                await asyncio.sleep(0)
            return await super().complete(request)

    records, orders = set(), set()
    for seed in range(50):
        folder = tmp_path / str(seed)
        folder.mkdir()
        with call_log_at(folder) as call_log:
            client = RecordingClient(Shuffled(random.Random(seed)), call_log)
            await asyncio.gather(*[client.complete(ask(label=f"t-{i}/1")) for i in range(10)])
        lines = (folder / "calls.jsonl").read_bytes().splitlines()
        orders.add(tuple(lines))
        records.add(tuple(sorted(lines)))
    assert len(records) == 1
    assert len(orders) > 10


async def test_replay_answers_from_the_call_log_alone(tmp_path: Path) -> None:
    with call_log_at(tmp_path) as call_log:
        await RecordingClient(echo(), call_log).complete(ask("hi", "a/1"))
    with call_log_at(tmp_path, writable=False) as call_log:
        client = ReplayClient(call_log, "scripted")
        assert client.name == "scripted"
        assert (await client.complete(ask("hi", "a/1"))).text == "to a/1: hi"
        await client.aclose()


MISSES = [
    (
        ask("build a catapult with two arms", "designer/2"),
        "nearest is 'designer/2', first difference: messages[0].text at character 22: "
        "recorded ' catapult with one arm', requested ' catapult with two arms'",
    ),
    (
        ask("build a catapult with one arm", "designer/3"),
        "nearest is 'designer/2', first difference: label at character 9: "
        "recorded 'designer/2', requested 'designer/3'",
    ),
    (
        ask("build a catapult with one arm", "designer/2", temperature=0.1),
        "nearest is 'designer/2', first difference: sampling.temperature at character 2: "
        "recorded '0.7', requested '0.1'",
    ),
    (
        ask("build a catapult with one arm", "designer/2").model_copy(
            update={
                "messages": (
                    *ask("build a catapult with one arm").messages,
                    Message(role="assistant", text="no"),
                )
            }
        ),
        "nearest is 'designer/2', first difference: messages[1].role is missing in the record",
    ),
]


@pytest.mark.parametrize(("request_", "text"), MISSES)
async def test_a_miss_names_the_nearest_and_what_differs(
    tmp_path: Path, request_: Request, text: str
) -> None:
    with call_log_at(tmp_path) as call_log:
        client = RecordingClient(echo(), call_log)
        await client.complete(ask("criticise", "inspector/2"))
        await client.complete(ask("build a catapult with one arm", "designer/2"))
        await client.complete(ask("build", "querier/1"))
        with pytest.raises(ReplayMissError) as caught:
            await ReplayClient(call_log, "scripted").complete(request_)
    assert str(caught.value) == (
        f"{tmp_path / 'calls.jsonl'} does not contain the call {request_.label!r}; {text}"
    )


async def test_a_miss_on_another_model_and_on_an_empty_call_log(tmp_path: Path) -> None:
    with call_log_at(tmp_path) as call_log:
        with pytest.raises(ReplayMissError, match=r"call 'a/1'; it contains no calls$"):
            await ReplayClient(call_log, "m").complete(ask())
        await RecordingClient(echo(), call_log).complete(ask())
        with pytest.raises(ReplayMissError) as caught:
            await ReplayClient(call_log, "other").complete(ask())
    assert str(caught.value).endswith(
        "first difference: model at character 0: recorded 'scripted', requested 'other'"
    )


async def test_a_closed_call_log_is_a_bug_not_a_silence(tmp_path: Path) -> None:
    call_log = call_log_at(tmp_path)
    call_log.close()
    with pytest.raises(ValueError, match="closed file"):
        await RecordingClient(echo(), call_log).complete(ask())
