"""One attempt against misbehaving endpoints: outcomes are typed, time is bounded."""

from __future__ import annotations

import asyncio
import re
import traceback

import pytest

from agentflow.errors import (
    EndpointError,
    RefusedError,
    SilentError,
    UnauthorisedError,
    UnreachableError,
)
from agentflow.llm.endpoint.faults import TransientFault
from agentflow.llm.messages import ToolCall, Usage
from tests.llm.helpers import KEY, ask, client_for, once
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

WHOLE = Usage(prompt=11, completion=7, reasoning=3, cached=5)


async def test_streamed_and_complete_answers_give_the_same_reply() -> None:
    usage = {"choices": [], "usage": completion("")["usage"]}
    streamed = stream(chunk(content="hel"), chunk(content="lo"), chunk("stop"), usage)
    async with serving(streamed, reply("hello")) as server:
        client = client_for(server.base_url)
        assert client.streams is None
        first = await client.complete(ask("hi"))
        assert client.streams is True
        second = await client.complete(ask("hi"))
        assert client.streams is False
        await client.aclose()
    assert first.model_copy(update={"latency_s": 0}) == second.model_copy(update={"latency_s": 0})
    assert (first.text, first.usage, first.model) == ("hello", WHOLE, "model-as-answered")
    assert first.latency_s > 0
    assert server.asked[0].target == "/v1/chat/completions"
    assert server.asked[0].headers["authorization"] == f"Bearer {KEY}"
    assert server.asked[0].body["model"] == "m"


async def test_streamed_and_complete_tool_calls_give_the_same_reply() -> None:
    call = {"id": "a", "function": {"name": "check", "arguments": f'{{"machine": "{KEY}"}}'}}
    pieces = [
        chunk(tool_calls=[{"index": 0, "id": "a", "function": {"name": "check"}}]),
        chunk(tool_calls=[{"index": 0, "function": {"arguments": '{"machine": '}}]),
        chunk(tool_calls=[{"index": 0, "function": {"arguments": f'"{KEY}"}}'}}]),
    ]
    whole = reply(None, "tool_calls", tool_calls=[call])
    async with serving(stream(*pieces, chunk("tool_calls")), whole) as server:
        client = client_for(server.base_url)
        calls = [(await client.complete(ask("hi"))).tool_calls for _ in range(2)]
        await client.aclose()
    assert calls == 2 * [(ToolCall(id="a", name="check", arguments='{"machine": "***"}'),)]


async def test_a_connection_is_reused_after_a_stream() -> None:
    async with serving(stream(chunk("stop", content="x"))) as server:
        client = client_for(server.base_url)
        for _ in range(5):
            await client.complete(ask())
        await client.aclose()
        assert (len(server.asked), server.connections) == (5, 1)


@pytest.mark.slow
async def test_a_stream_that_stays_open_after_its_end_mark_is_dropped() -> None:
    async def answer(writer: asyncio.StreamWriter) -> None:
        head = b"HTTP/1.1 200 OK\r\nContent-Type: text/event-stream\r\n\r\n"
        writer.write(head + b'data: {"choices":[{"delta":{"content":"x"}}]}\n\ndata: [DONE]\n\n')
        await silence(writer)

    async with serving(answer) as server:
        assert (await once(server.base_url)).text == "x"


async def test_a_stream_without_an_end_mark_but_with_a_finish_reason_is_complete() -> None:
    async with serving(stream(chunk(content="x"), chunk("length"), done=False)) as server:
        answer = await once(server.base_url)
    assert (answer.text, answer.finish) == ("x", "length")


async def test_a_stream_with_the_wrong_content_type_is_a_stream() -> None:
    text = 'data: {"choices": [{"delta": {"content": "x"}, "finish_reason": "stop"}]}\n\n'
    async with serving(body(text + "data: [DONE]\n\n", kind="text/plain")) as server:
        assert (await once(server.base_url)).text == "x"


async def test_any_success_is_an_answer() -> None:
    async with serving(body(completion("x"), 201)) as server:
        assert (await once(server.base_url)).text == "x"


async def test_a_lone_surrogate_in_a_prompt_is_replaced() -> None:
    async with serving(reply("x")) as server:
        await once(server.base_url, ask("a\ud83d \U0001f600"))
    assert server.asked[0].body["messages"][0]["content"] == "a\ufffd \U0001f600"


async def test_no_key_sends_no_header() -> None:
    async with serving(body({"error": {"message": "who?"}}, 401)) as server:
        client = client_for(server.base_url, key=None)
        with pytest.raises(UnauthorisedError) as caught:
            await client.complete(ask())
        await client.aclose()
        assert "authorization" not in server.asked[0].headers
        assert (
            str(caught.value) == f"{server.base_url} requires an API key (401); set OPENAI_API_KEY"
        )


HALF = b'HTTP/1.1 200 OK\r\nContent-Length: 900\r\n\r\n{"choices": [{"mes'
ENDLESS = b"HTTP/1.1 200 OK\r\nContent-Type: text/event-stream\r\n\r\n"
LOST: dict[str, tuple[Answer, str]] = {
    "before the headers": (hang_up, "disconnected"),
    "in the body": (raw(HALF, close=True), "peer closed connection"),
    "in the stream": (stream(chunk(content="x"), done=False, close=True), "peer closed"),
    "in a stream without length": (
        raw(ENDLESS + b'data: {"choices":[{"delta":{"content":"x"}}]}\n\n', close=True),
        "the stream ended early",
    ),
    "before the first event": (raw(ENDLESS + b": wait\n\n", close=True), "the stream ended early"),
    "nothing comes": (silence, "no data for 0.2 s"),
    "stalled in the stream": (
        raw(ENDLESS, b"data: {", b"", pause_s=30.0),
        "no data for 0.2 s",
    ),
    "trickling": (
        raw(ENDLESS, *[b":"] * 100, pause_s=0.05),
        "no complete reply within 0.5 s",
    ),
    "half a JSON": (body('{"choices": [{"mess'), "the answer's JSON is incomplete"),
    "an empty body": (body(""), "the answer's JSON is incomplete"),
    "a chunk without a size": (
        raw(b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\nZZ\r\n{}\r\n"),
        "illegal chunk header",
    ),
    "headers without end": (
        raw(b"HTTP/1.1 200 OK\r\n", *[b"X: %b\r\n" % (b"x" * 2**16)] * 4),
        "Receive buffer too long",
    ),
    "no HTTP": (raw(b"SSH-2.0-x\r\n\r\n", close=True), "illegal status line"),
    "not gzip": (body("hello", Content_Encoding="gzip"), "incorrect header check"),
}


LIMITS: dict[str, dict[str, float]] = {
    "no data for 0.2 s": {"idle_s": 0.2},
    "no complete reply within 0.5 s": {"total_s": 0.5},
}
"""Settings of the faults that a limit of time ends; others come before any limit."""


@pytest.mark.parametrize("fault", LOST)
async def test_lost_answers_may_be_retried(fault: str) -> None:
    answer, reason = LOST[fault]
    async with serving(answer) as server:
        with pytest.raises(TransientFault) as caught:
            await once(server.base_url, **LIMITS.get(reason, {}))
        error, url = caught.value.error, server.base_url
        assert type(error) is (SilentError if reason.startswith("no data") else UnreachableError)
        whole = (
            rf"no (answer|complete reply|data for 0\.2 s) from {url}"
            r"(?: \(.*\)|, which is connected)[;:] (.*)"
        )
        found = re.fullmatch(whole, str(caught.value))
        assert found
        assert reason in str(caught.value)
        advice = {
            "answer": "check OPENAI_BASE_URL or --base-url",
            "complete reply": "the server, or a proxy before it, cut it off: check their logs and "
            "size limits",
            "data for 0.2 s": "the model may be slow; model.endpoint.http.idle_s sets how long "
            "runs wait",
        }
        assert found[2] == advice[found[1]]


async def test_no_server() -> None:
    async with serving(silence) as server:
        base_url = server.base_url
    with pytest.raises(TransientFault) as caught:
        await once(base_url)
    assert str(caught.value) == (
        f"no answer from {base_url} (connection refused: is the server running?); "
        "check OPENAI_BASE_URL or --base-url"
    )


FINAL: dict[str, tuple[Answer, str]] = {
    "HTML": (
        body("<!doctype html>", kind="text/html"),
        "did not return a chat completion (an HTML page);",
    ),
    "words": (body("hello"), "did not return a chat completion (it starts with 'hello');"),
    "no choices": (body({"choices": []}), "did not return a chat completion (no choices);"),
    "an error object": (
        body({"error": {"message": f"bad {KEY}", "code": 400}}),
        "rejected the request (400: bad ***)",
    ),
    "an error in the stream": (
        stream(chunk(content="x"), {"error": {"message": "too long"}}),
        "rejected the request (400: too long)",
    ),
    "400": (body({"error": {"message": "prompt too long"}}, 400), "(400: prompt too long)"),
    "a redirection": (body("", 307, Location="http://x/y"), "(307: a redirect to http://x/y)"),
}


@pytest.mark.parametrize("fault", FINAL)
async def test_other_answers_are_final(fault: str) -> None:
    answer, text = FINAL[fault]
    async with serving(answer) as server:
        with pytest.raises(RefusedError) as caught:
            await once(server.base_url)
        assert text in str(caught.value)
        assert server.base_url in str(caught.value)


async def test_an_overload_inside_the_stream_may_be_retried() -> None:
    error = {"error": {"message": "busy", "type": "overloaded_error"}}
    async with serving(stream(chunk(content="x"), error)) as server:
        with pytest.raises(TransientFault) as caught:
            await once(server.base_url)
    assert type(caught.value.error) is RefusedError
    assert "is temporarily unavailable (529: busy)" in str(caught.value)


@pytest.mark.slow
async def test_twenty_megabytes() -> None:
    text = "abcdefgh" * (20 * 2**20 // 8)
    async with serving(reply(text)) as server:
        assert (await once(server.base_url)).text == text


async def test_answers_above_the_size_limit_are_rejected() -> None:
    megabyte = b"x" * 2**20
    async with serving(raw(b"HTTP/1.1 200 OK\r\n\r\n", *[megabyte] * 70, close=True)) as server:
        with pytest.raises(RefusedError, match="more than 64 MB"):
            await once(server.base_url)


async def test_null_content_is_an_empty_reply() -> None:
    async with serving(reply(None)) as server:
        assert (await once(server.base_url)).finish == "empty"


async def test_an_unsupported_parameter_is_omitted_from_then_on() -> None:
    def refuses(name: str) -> Answer:
        text = f"Unsupported parameter: '{name}' is not supported with this model."
        return body({"error": {"message": text, "param": name}}, 400)

    warnings: list[str] = []
    names = ["max_tokens", "temperature", "seed"]
    async with serving(*[refuses(name) for name in names], reply("ok")) as server:
        client = client_for(server.base_url, warn=warnings.append)
        request = ask(max_tokens=5, seed=1)
        assert (await client.complete(request)).text == "ok"
        assert (await client.complete(request)).text == "ok"
        await client.aclose()
    assert [len(asked.body) for asked in server.asked] == [8, 8, 7, 6, 6]
    assert server.asked[-1].body["max_completion_tokens"] == 5
    assert list(client.unsupported.actions) == names
    assert len(warnings) == 3
    assert warnings[1] == (
        "the endpoint does not support temperature: omitted from now on "
        "(Unsupported parameter: 'temperature' is not supported with this model.)"
    )


async def test_the_key_is_in_no_reply() -> None:
    echo = completion(f"your key is {KEY}", reasoning=KEY)
    async with serving(body({**echo, "model": KEY}), body(f"Bearer {KEY}", 500)) as server:
        client = client_for(server.base_url)
        first = await client.complete(ask())
        with pytest.raises(EndpointError) as caught:
            await client.complete(ask())
        await client.aclose()
    assert first.text == "your key is ***"
    assert KEY not in f"{first!r} {caught.value!r} {client!r} {vars(client)!r}"
    assert caught.value.__suppress_context__ or caught.value.__context__ is None


@pytest.mark.parametrize(
    "answer",
    [
        body({"error": {"message": KEY, "param": KEY, "code": KEY}}, 400),
        body("x" * 45 + KEY),
        body(f'["{"x" * 45}{KEY}"]'),
        body("", 308, Location=f"https://u:{KEY}@h/v1?key={KEY}"),
        raw(f"HTTX {KEY}\r\n\r\n".encode(), close=True),
    ],
)
async def test_no_part_of_the_key_is_in_an_error_or_its_traceback(answer: Answer) -> None:
    async with serving(answer) as server:
        with pytest.raises(EndpointError) as caught:
            await once(server.base_url)
    frames = traceback.TracebackException.from_exception(caught.value, capture_locals=True)
    ours = [line for line in frames.format() if "/tests/" not in line]
    assert KEY[:12] not in f"{caught.value} {''.join(ours)}"


async def test_calls_may_be_cancelled() -> None:
    async with serving(silence) as server:
        client = client_for(server.base_url)
        task = asyncio.create_task(client.complete(ask()))
        await asyncio.sleep(0.05)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
        await client.aclose()
