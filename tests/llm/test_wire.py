"""Replies."""

from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agentflow.llm.endpoint.wire import (
    ErrorObjectError,
    NotACompletionError,
    ReplyBuilder,
    TruncatedAnswerError,
    decode,
    read_usage,
    split_reasoning,
)
from agentflow.llm.messages import Reply, Usage
from tests.llm.hostile import chunk, completion


def gathered(*contents: dict[str, object]) -> Reply:
    reply = ReplyBuilder()
    for content in contents:
        reply.add(content)
    return reply.reply()


def test_a_whole_answer() -> None:
    assert gathered(completion("hi", reasoning_content="hm")) == Reply(
        text="hi",
        reasoning="hm",
        usage=Usage(prompt=11, completion=7, reasoning=3, cached=5),
        model="model-as-answered",
    )


@pytest.mark.parametrize("name", ["reasoning_content", "reasoning"])
def test_reasoning_beside_the_text_in_a_stream(name: str) -> None:
    thoughts = [chunk(**{name: part}) for part in ("let ", "me see")]
    reply = gathered(*thoughts, chunk(content="a"), chunk(content="b"), chunk("stop"))
    assert (reply.text, reply.reasoning, reply.finish) == ("ab", "let me see", "stop")


@pytest.mark.parametrize(
    ("text", "rest", "thought"),
    [
        ("plain", "plain", ""),
        ("  plain ", "  plain ", ""),
        ("<think>\nwhy\n</think>\n\nbecause", "because", "why"),
        ("why</think>because", "because", "why"),
        ("<think>never ends", "", "never ends"),
        ("<think></think>x", "x", ""),
        ("<think>a</think>b <think>c</think>d", "b d", "a\nc"),
    ],
)
def test_reasoning_inside_the_text(text: str, rest: str, thought: str) -> None:
    assert split_reasoning(text) == (rest, thought)


@pytest.mark.parametrize(
    ("text", "word", "finish"),
    [
        ("x", "stop", "stop"),
        ("x", "eos", "stop"),
        ("x", "length", "length"),
        (None, "length", "length"),
        ("x", "content_filter", "content_filter"),
        (None, "SAFETY", "content_filter"),
        (None, "stop", "empty"),
        (" \n", "stop", "empty"),
        ("<think>only thoughts</think>", "stop", "empty"),
    ],
)
def test_finish(text: str | None, word: str, finish: str) -> None:
    assert gathered(completion(text, word)).finish == finish


def test_a_reply_of_tool_calls_only() -> None:
    calls = [{"type": "function", "function": {"name": "f", "arguments": "{}"}}]
    assert gathered(completion(None, "tool_calls", tool_calls=calls)).finish == "tool_calls"


def test_a_refusal_counts_as_filtered_content() -> None:
    reply = gathered(completion(None, refusal="I will not."))
    assert (reply.text, reply.finish) == ("I will not.", "content_filter")


def test_content_as_parts() -> None:
    parts = [
        {"type": "thinking", "thinking": [{"type": "text", "text": "hm"}]},
        {"type": "text", "text": "hi"},
    ]
    reply = gathered(chunk("stop", content=parts))
    assert (reply.text, reply.reasoning) == ("hi", "hm")


def test_a_split_emoji_is_joined_and_half_of_one_replaced() -> None:
    reply = gathered(chunk(content="\ud83d"), chunk(content="\ude00 \ud83d"), chunk("stop"))
    assert reply.text == "\U0001f600 \ufffd"
    assert Reply.model_validate_json(reply.model_dump_json()) == reply


def test_the_usage_chunk_has_no_choices() -> None:
    last = {"choices": None, "usage": {"prompt_tokens": 4, "completion_tokens": 2}}
    assert gathered(chunk("stop", content="x"), last).usage == Usage(prompt=4, completion=2)


@pytest.mark.parametrize(
    ("usage", "expected"),
    [
        ({}, Usage()),
        ({"prompt_tokens": None, "completion_tokens": "7"}, Usage()),
        ({"prompt_tokens": 2.0, "prompt_cache_hit_tokens": 1}, Usage(prompt=2, cached=1)),
        ({"prompt_tokens": -1, "completion_tokens": True}, Usage()),
    ],
)
def test_usage(usage: dict[str, object], expected: Usage) -> None:
    assert read_usage(usage) == expected


def test_an_answer_without_choices_is_not_a_reply() -> None:
    with pytest.raises(NotACompletionError, match=r"^no choices$"):
        gathered({"choices": []})


def test_a_stream_that_ends_with_the_whole_message_counts_it_once() -> None:
    parts = [chunk(reasoning_content="h"), chunk(reasoning_content="m"), chunk(content="hi")]
    assert gathered(*parts, completion("hi", reasoning_content="hm")) == gathered(
        completion("hi", reasoning_content="hm")
    )
    assert gathered(*parts, completion("")).text == "hi"


def test_messages_beside_or_instead_of_empty_deltas_are_read() -> None:
    empty = {"role": "assistant", "content": ""}
    both = {"choices": [{"delta": empty, "message": {"role": "assistant", "content": "hi"}}]}
    assert gathered(both).text == "hi"
    assert gathered(completion("Hel"), completion("lo")).text == "Hello"


def test_an_endpoint_that_reports_its_own_failure() -> None:
    with pytest.raises(TruncatedAnswerError):
        gathered(completion("half", "error"))


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ('{"choices": [{"mess', TruncatedAnswerError),
        ("", TruncatedAnswerError),
        ("<html>", NotACompletionError),
        ("hello", NotACompletionError),
        ("[1]", NotACompletionError),
        ('{"error": {"message": "x"}}', ErrorObjectError),
        ('{"object": "error", "message": "x"}', ErrorObjectError),
        ("[" * 100_000, TruncatedAnswerError),
    ],
)
def test_answers_that_are_not_completions(text: str, kind: type[Exception]) -> None:
    with pytest.raises(kind):
        decode(text)


KEYS = ("choices", "message", "delta", "content", "text", "usage", "finish_reason", "model")
JSON = st.recursive(
    st.none() | st.booleans() | st.floats() | st.text(max_size=5),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(
            st.sampled_from(KEYS),
            inner,
            max_size=4,
        )
    ),
    max_leaves=15,
)


@given(st.lists(JSON, max_size=3))
def test_any_json_is_a_reply_or_a_typed_failure(values: list[object]) -> None:
    reply = ReplyBuilder()
    try:
        for value in values:
            reply.add(decode(json.dumps(value)))
        assert isinstance(reply.reply(), Reply)
    except (NotACompletionError, TruncatedAnswerError, ErrorObjectError):
        pass
