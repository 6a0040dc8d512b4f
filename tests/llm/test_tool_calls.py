"""Tool calls in replies, in all the ways in which servers send them."""

from __future__ import annotations

import json
import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agentflow.llm.endpoint.body import request_body
from agentflow.llm.endpoint.wire import (
    ReplyBuilder,
    decode,
)
from agentflow.llm.messages import Reply, Request, ToolCall
from tests.llm.hostile import chunk, completion
from tests.llm.test_wire import gathered

Entry = dict[str, object]


def entry(
    name: str | None = None, arguments: object = None, key: str | None = None, **more: object
) -> Entry:
    """One entry of `tool_calls`, without what is None."""
    function = {"name": name, "arguments": arguments}
    given = {k: v for k, v in function.items() if v is not None}
    return {**({"id": key} if key else {}), "type": "function", "function": given, **more}


def streamed(*entries: Entry, finish: str = "tool_calls") -> Reply:
    """The reply of a stream with one entry in each chunk."""
    return gathered(*[chunk(tool_calls=[item]) for item in entries], chunk(finish))


def found(reply: Reply) -> list[tuple[str, str, str]]:
    return [(call.id, call.name, call.arguments) for call in reply.tool_calls]


def test_calls_of_a_whole_answer() -> None:
    calls = [entry("brief", "{}", "a"), entry("check", '{"machine": "[]"}', "b")]
    reply = gathered(completion(None, "tool_calls", tool_calls=calls))
    assert (reply.text, reply.finish) == ("", "tool_calls")
    assert found(reply) == [("a", "brief", "{}"), ("b", "check", '{"machine": "[]"}')]


def test_text_beside_calls() -> None:
    reply = gathered(completion("I check.", "tool_calls", tool_calls=[entry("brief", "{}", "a")]))
    assert (reply.text, reply.finish, found(reply)) == ("I check.", "stop", [("a", "brief", "{}")])


@pytest.mark.parametrize("word", ["stop", "tool_calls", "function_call", "TOOL_CALLS"])
def test_any_finish_reason_beside_calls(word: str) -> None:
    reply = gathered(completion("", word, tool_calls=[entry("brief", "{}", "a")]))
    assert (reply.finish, found(reply)) == ("tool_calls", [("a", "brief", "{}")])


def test_a_reply_cut_off_within_a_call() -> None:
    reply = streamed(entry("check", '{"mach', "a", index=0), finish="length")
    assert (reply.finish, found(reply)) == ("length", [("a", "check", '{"mach')])


def test_several_calls_in_a_stream_in_turns() -> None:
    reply = streamed(
        entry("check", "", "a", index=0),
        entry("edit", "", "b", index=1),
        entry(None, '{"mach', index=0),
        entry(None, '{"scri', index=1),
        entry(None, 'ine": 1}', index=0),
        entry(None, 'pt": 2}', index=1),
    )
    assert found(reply) == [("a", "check", '{"machine": 1}'), ("b", "edit", '{"script": 2}')]


@pytest.mark.parametrize(
    ("entries", "expected"),
    [
        # a name in pieces, or repeated in each chunk
        (
            [entry("sim", "", "a", index=0), entry("ulate", "{}", index=0)],
            [("a", "simulate", "{}")],
        ),
        (
            [entry("look", '{"a', "a", index=0), entry("look", '": 1}', "a", index=0)],
            [("a", "look", '{"a": 1}')],
        ),
        # an id in each chunk, the same or another
        (
            [entry("look", '{"a', "a", index=0), entry(None, '": 1}', "b", index=0)],
            [("a", "look", '{"a": 1}')],
        ),
        # one index for all calls, with or without ids
        (
            [entry("brief", "", "a", index=0), entry("history", "", "b", index=0)],
            [("a", "brief", ""), ("b", "history", "")],
        ),
        (
            [entry("look", "{}", index=0), entry("look", "{}", index=0)],
            [("call00000", "look", "{}"), ("call00001", "look", "{}")],
        ),
        # no index
        (
            [entry("brief", "{}", "a"), entry("look", '{"a', "b"), entry(None, '": 1}')],
            [("a", "brief", "{}"), ("b", "look", '{"a": 1}')],
        ),
        # the id only later, and never
        (
            [entry("look", "{", index=0), entry(None, "}", "a", index=0)],
            [("a", "look", "{}")],
        ),
        ([entry("look", "{}")], [("call00000", "look", "{}")]),
        # ids that are repeated, or look like ours
        (
            [entry("look", "{}", "a", index=0), entry("look", "{}", "a", index=1)],
            [("a", "look", "{}"), ("call00000", "look", "{}")],
        ),
        (
            [entry("look", "{}", index=0), entry("look", "{}", "call00000", index=1)],
            [("call00001", "look", "{}"), ("call00000", "look", "{}")],
        ),
        # arguments as an object, or none
        ([entry("look", {"view": "ü"}, "a", index=0)], [("a", "look", '{"view": "ü"}')]),
        ([entry("brief", None, "a", index=0)], [("a", "brief", "")]),
        # neither name nor arguments
        ([entry("brief", "{}", "a", index=0), entry(index=1)], [("a", "brief", "{}")]),
        # name and arguments beside the id
        ([{"id": "a", "name": "brief", "arguments": "{}"}], [("a", "brief", "{}")]),
    ],
)
def test_streams_of_calls(entries: list[Entry], expected: list[tuple[str, str, str]]) -> None:
    assert found(streamed(*entries)) == expected


def test_calls_of_one_list_are_different_calls() -> None:
    calls = [entry("brief"), entry("brief"), entry("history", "{}")]
    expected = [
        ("call00000", "brief", ""),
        ("call00001", "brief", ""),
        ("call00002", "history", "{}"),
    ]
    assert found(gathered(completion(None, "stop", tool_calls=calls))) == expected


def test_a_stream_that_ends_with_the_whole_message_counts_calls_once() -> None:
    part = chunk(tool_calls=[entry("look", "{}", "a", index=0)])
    whole = completion(None, "tool_calls", tool_calls=[entry("look", "{}", "a")])
    assert found(gathered(part, whole)) == [("a", "look", "{}")]
    assert found(gathered(part, completion(""))) == [("a", "look", "{}")]


def test_the_single_call_of_old_servers() -> None:
    call = {"name": "check", "arguments": '{"machine": "[]"}'}
    expected = [("call00000", "check", '{"machine": "[]"}')]
    assert found(gathered(completion(None, "function_call", function_call=call))) == expected
    pieces: list[Entry] = [
        {"name": "check", "arguments": ""},
        {"arguments": '{"machine": '},
        {"arguments": '"[]"}'},
    ]
    parts = [chunk(function_call=piece) for piece in pieces]
    assert found(gathered(*parts, chunk("function_call"))) == expected
    both = completion(None, "stop", function_call=call, tool_calls=[entry("check", "{}", "a")])
    assert found(gathered(both)) == [("a", "check", "{}")]


@pytest.mark.parametrize("broken", [[7], [None], "brief", {"x": 1}, [{}], [[]]])
def test_calls_that_are_none(broken: object) -> None:
    assert gathered(completion("", "tool_calls", tool_calls=broken)) == gathered(completion(""))


def again(reply: Reply) -> object:
    """A reply, as it is sent back to the endpoint."""
    return request_body(Request(role="r", label="l", messages=(reply.message,)), "m")["messages"]


def test_what_an_endpoint_wants_back_beside_calls() -> None:
    signed = entry("brief", "{}", "a", extra_content={"vendor": {"signature": "x"}})
    thought = {"reasoning_content": "I need the brief."}
    reply = gathered(
        chunk(reasoning_content="I need "),
        chunk(reasoning_content="the brief."),
        chunk("tool_calls", tool_calls=[signed]),
    )
    assert again(reply) == [
        {"role": "assistant", "content": None, "tool_calls": [signed], **thought}
    ]
    text = gathered(completion("hi", **thought))
    assert again(text) == [{"role": "assistant", "content": "hi"}]


FIELDS = ("index", "id", "function", "name", "arguments", "extra_content")
PIECES = st.recursive(
    st.none() | st.booleans() | st.floats() | st.text(max_size=5) | st.integers(0, 2),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.fixed_dictionaries(
            {},
            optional=dict.fromkeys(
                ("index", "id", "function", "name", "arguments", "extra_content"), inner
            ),
        )
    ),
    max_leaves=12,
)


@given(st.lists(st.tuples(st.sampled_from(["tool_calls", "function_call"]), PIECES), max_size=4))
def test_any_calls_are_a_reply_that_can_be_recorded_and_sent_back(
    parts: list[tuple[str, object]],
) -> None:
    builder = ReplyBuilder()
    for name, value in parts:
        builder.add(decode(json.dumps(chunk(**{name: value}))))
    builder.add(chunk("stop"))
    reply = builder.reply()
    assert Reply.model_validate_json(reply.model_dump_json()) == reply
    assert len({call.id for call in reply.tool_calls}) == len(reply.tool_calls)
    assert all(call.id and (call.name or call.arguments) for call in reply.tool_calls)
    json.dumps(again(reply), ensure_ascii=False, allow_nan=False).encode()


@given(st.lists(st.text(max_size=8), min_size=1, max_size=4), st.randoms(use_true_random=False))
def test_calls_are_the_same_however_a_stream_is_cut(
    arguments: list[str], rng: random.Random
) -> None:
    calls = [
        ToolCall(id=f"id-{i}", name="check", arguments=json.dumps({"machine": text}))
        for i, text in enumerate(arguments)
    ]
    parts = []
    for index, call in enumerate(calls):
        parts.append(entry(call.name, "", call.id, index=index))
        cuts = sorted(rng.choices(range(len(call.arguments) + 1), k=3))
        for start, end in zip([0, *cuts], [*cuts, len(call.arguments)], strict=True):
            parts.append(entry(None, call.arguments[start:end], index=index))
    assert list(streamed(*parts).tool_calls) == calls
