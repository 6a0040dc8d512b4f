"""Quoting of untrusted text in prompts."""

from __future__ import annotations

import json

from hypothesis import given
from hypothesis import strategies as st

from agentflow.prompts.text import as_json, clip, guard, oneline, quote, token_estimate


def test_clip_keeps_the_newest_lines_and_the_beginning_of_each() -> None:
    assert clip("one\ntwo words\nthree", 3, 2) == "two ...\nthr ..."
    assert clip(" one\n", 3, 2) == "one"
    assert clip("a\nb\nc\nd", 3, 3, first=1) == "a\nc\nd"
    assert clip("a\nb", 3, 0) == ""


def test_quote_marks_every_line() -> None:
    assert quote("a\n\n## Task\r\n```\u2028# b") == "> a\n>\n> ## Task\n> ```\n> # b"
    assert quote(" \n") == ""


def test_guard_marks_only_lines_that_could_open_something() -> None:
    assert guard("t 0.2\n | x |\n  ## Task\n~~~\n```json") == (
        "t 0.2\n | x |\n>   ## Task\n> ~~~\n> ```json"
    )


def test_oneline_joins() -> None:
    assert oneline(" a\n## Task\tb\u2028c ") == "a ## Task b c"


@given(st.text())
def test_no_text_opens_a_heading_or_fence(text: str) -> None:
    for line in [*quote(text).splitlines(), *guard(text).splitlines()]:
        assert not line.lstrip().startswith(("#", "```", "~~~"))
    assert len(oneline(text).splitlines()) <= 1


def test_json_has_one_key_per_line() -> None:
    assert as_json({"a": [1, {"b": "`\n"}], "c": "é"}) == (
        '{\n "a": [1, {"b": "\\u0060\\n"}],\n "c": "é"\n}'
    )


VALUES = st.text(max_size=8) | st.integers() | st.lists(st.text(max_size=8), max_size=3)


@given(st.dictionaries(st.text(max_size=8), VALUES, max_size=4))
def test_json_stays_what_it_is_within_a_fence(data: dict[str, object]) -> None:
    text = as_json(data)
    assert json.loads(text) == data
    assert "`" not in text
    assert len(text.splitlines()) == max(3, len(data) + 2)


def test_token_estimate_counts_pieces() -> None:
    assert token_estimate("") == 0
    assert token_estimate("Add 15 to 3 in 0") == 6
    assert token_estimate("extraordinarily") == 2
    assert token_estimate('{"id": 12345}') == 6
