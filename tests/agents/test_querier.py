"""Queries in replies."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agentflow.agents.querier import Querier, QuerierInput
from tests.agents.fakes import FRAME, MOVEMENT

GIVEN = QuerierInput(MOVEMENT, FRAME, 3.0, "Score: 3.00 m")
ONE = {"id": 3, "duration": [0, 1], "properties": ["position"]}
TEXT = '{"id": 3, "duration": [0, 1], "properties": ["position"]}'


@pytest.mark.parametrize(
    ("wanted", "queries", "repaired"),
    [
        (f"[{TEXT}]", (ONE,), False),
        (f"```json\n[{TEXT},\n{TEXT}]\n```", (ONE, ONE), False),
        (TEXT, (ONE,), False),
        (f"[{TEXT.replace(chr(34), chr(39))},]", (ONE,), True),
        ('["no query", 7]', ("no query", 7), False),
        ("[]", (), False),
        ("{}", ({},), False),
        ("", (), False),
        ("None.", (), False),
    ],
)
def test_queries(wanted: str, queries: tuple[object, ...], repaired: bool) -> None:
    text = f"<thought process>why</thought process><Required Feedback>{wanted}</Required Feedback>"
    parsed = Querier().parse(text, GIVEN)
    assert (parsed.output, parsed.repaired) == (queries, repaired)


def test_missing_section() -> None:
    parsed = Querier().parse(f"[{TEXT}]", GIVEN)
    assert (parsed.output, parsed.code) == (None, "missing_section")
    assert parsed.problem == "The reply has no section <Required Feedback>."


def test_no_list() -> None:
    parsed = Querier().parse("<Required Feedback>the position of block 3", GIVEN)
    assert (parsed.output, parsed.code) == (None, "unparsable")
    assert parsed.problem == (
        "<Required Feedback> contains no JSON list. Example: "
        '[{"id": 3, "duration": [0.0, 1.0], "properties": ["position"]}]'
    )


@given(st.text())
def test_never_raises(text: str) -> None:
    Querier().parse(f"<Required Feedback>{text}", GIVEN)
