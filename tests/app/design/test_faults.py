"""Faults of an endpoint raise the right error, are recorded, and never show the key."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from agentflow.app.design.notices import REMARK, Remarks
from agentflow.errors import EndpointError, RefusedError, UnreachableError
from agentflow.llm.build import open_client, wrap
from agentflow.llm.endpoint.body import Endpoint
from agentflow.llm.messages import Reply
from agentflow.llm.settings import EndpointSettings
from agentflow.llm.wrappers.budget import Budget
from agentflow.llm.wrappers.record import CallLog
from agentflow.runs import RunDirectory, read_events
from tests.llm.helpers import KEY, ask
from tests.llm.hostile import (
    Answer,
    body,
    chunk,
    completion,
    hang_up,
    raw,
    reply,
    serving,
    silence,
    stream,
)

LIMITS = {"byte by byte": {"total_s": 0.5}, "no answer": {"idle_s": 0.2}}
"""Settings of the faults that a limit of time ends; others come before any limit."""
HEAD = b"HTTP/1.1 200 OK\r\nContent-Type: text/event-stream\r\n\r\n"
HALF = b'HTTP/1.1 200 OK\r\nContent-Length: 900\r\n\r\n{"choices": [{"mes'
LEAK = f"key {KEY} Bearer {KEY}"


def busy(wait: str) -> Answer:
    return body({"error": {"message": LEAK}}, 429, Retry_After=wait)


def refuses(name: str, words: str) -> Answer:
    return body({"error": {"message": words, "param": name}}, 400)


FAULTS: dict[str, tuple[list[Answer], type[Reply] | type[EndpointError], str]] = {
    # what the server does: its answers, the outcome, what the record says
    "dropped before the headers": ([hang_up], UnreachableError, "disconnected"),
    "dropped in the body": ([raw(HALF, close=True)], UnreachableError, "peer closed connection"),
    "dropped before [DONE]": (
        [stream(chunk(content="x"), done=False, close=True)],
        UnreachableError,
        "peer closed connection",
    ),
    "ended before [DONE]": (
        [stream(chunk(content="x"), done=False)],
        UnreachableError,
        "the stream ended early",
    ),
    "byte by byte": (
        [raw(HEAD, *[b":"] * 40, pause_s=0.05)],
        UnreachableError,
        "no complete reply within 0.5 s",
    ),
    "no answer": ([silence], UnreachableError, "no data for 0.2 s"),
    "HTML": ([body("<html>", kind="text/html")], RefusedError, "(an HTML page)"),
    "half a JSON": ([body('{"choices": [{')], UnreachableError, "the answer's JSON is incomplete"),
    "null content": ([reply(None)], Reply, '"finish":"empty"'),
    "an error with status 200": (
        [body({"error": {"message": LEAK, "code": 400}})],
        RefusedError,
        "rejected the request (400: key *** Bearer ***)",
    ),
    "an overload with status 200": (
        [body({"error": {"message": LEAK, "type": "overloaded_error"}}), reply("ok")],
        Reply,
        "is temporarily unavailable (529: key *** Bearer ***); retrying in",
    ),
    "Retry-After in seconds": ([busy("0"), reply("ok")], Reply, "; retrying in 0.0 s"),
    "Retry-After as a date": (
        [busy("Wed, 01 Jan 2020 00:00:00 GMT"), reply("ok")],
        Reply,
        "(429: key *** Bearer ***); retrying in 0.0 s",
    ),
    "Retry-After as nonsense": ([busy("soon"), reply("ok")], Reply, "(429: key *** Bearer ***)"),
    "a refused parameter": (
        [refuses("seed", f"seed is not supported, {LEAK}"), reply("ok")],
        Reply,
        "does not support seed: omitted from now on (seed is not supported, key *** Bearer ***)",
    ),
    "reasoning_content": ([reply("a", reasoning_content="hm")], Reply, '"reasoning":"hm"'),
    "reasoning": ([reply("a", reasoning="hm")], Reply, '"reasoning":"hm"'),
    "think tags": ([reply("<think>hm</think>a")], Reply, '"reasoning":"hm"'),
    "20 MB": ([reply("0123456789" * 2**21)], Reply, "0123456789" * 2**21),
    "cut off at the length": ([reply("a", "length")], Reply, '"finish":"length"'),
    "filtered": ([reply("a", "content_filter")], Reply, '"finish":"content_filter"'),
    "the key in a reply": (
        [body({**completion(LEAK, reasoning=LEAK), "model": KEY})],
        Reply,
        '"text":"key *** Bearer ***"',
    ),
    "401": ([body({"error": {"message": LEAK}}, 401)], EndpointError, "check OPENAI_API_KEY"),
    "404": ([body({"detail": LEAK}, 404)], EndpointError, "does not know model"),
}


@contextmanager
def kept(folder: Path) -> Iterator[tuple[RunDirectory, CallLog, Remarks]]:
    run = RunDirectory.create(folder, "run", {})
    remarks = Remarks(run, lambda _line: None)
    with CallLog(run.call_log, remarks.tell) as call_log:
        yield run, call_log, remarks
    run.close()


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.slow
async def test_a_fault_is_typed_bounded_recorded_and_keyless(fault: str, tmp_path: Path) -> None:
    answers, kind, said = FAULTS[fault]
    outcome: Reply | EndpointError
    async with serving(*answers) as server:
        endpoint = Endpoint("m", server.base_url, KEY)
        with kept(tmp_path) as (run, call_log, remarks):
            reached = open_client(
                endpoint,
                settings=EndpointSettings.model_validate(
                    {
                        "http": LIMITS.get(fault, {}),
                        "retry": {"attempts": 2, "base_s": 0.001},
                    }
                ),
                warn=remarks.tell,
                on_wait=remarks.tell,
            )
            client = wrap(reached, call_log=call_log, budget=Budget())
            try:
                outcome = await client.complete(ask("hi", "designer/1", seed=1))
            except EndpointError as error:
                outcome = error
                remarks.record(str(error))
            await client.aclose()
    assert isinstance(outcome, kind)
    remarked = [event.data["text"] for event in read_events(run.path) if event.kind == REMARK]
    calls = run.call_log.read_text()
    assert said in calls or any(said in line for line in remarked)
    assert len(calls.splitlines()) == isinstance(outcome, Reply)
    for path in tmp_path.rglob("*"):
        assert path.is_dir() or KEY not in path.read_text()
    assert KEY not in f"{outcome!r}{json.dumps(remarked)}"
