"""Parsers survive everything: typed outcomes, no exceptions, time linear in length."""

from __future__ import annotations

from collections import Counter

import pytest

from tests.agents.fuzz import CASES, fault, outcomes, replies


@pytest.mark.parametrize("case", CASES, ids=lambda case: case[0].name)
def test_unmutated_replies_are_of_use(case) -> None:  # type: ignore[no-untyped-def]
    role, given = case
    assert any(role.parse(text, given).output is not None for text in replies(case))


@pytest.mark.slow
def test_mutated_replies() -> None:
    """`benchmarks/fuzz.py` tries many more."""
    count = 4_000
    read = Counter[bool]()
    for name, text, parsed, slowness in outcomes(count, seed=count):
        assert not fault(text, parsed, slowness), (name, fault(text, parsed, slowness), text[:500])
        read[parsed.output is not None] += 1
    assert min(read[True], read[False]) > count / 20, read
