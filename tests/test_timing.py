"""The helper that tells linear from quadratic time does tell them apart."""

from __future__ import annotations

import pytest

from tests.timing import assert_linear, repeated


def test_linear_work_passes() -> None:
    assert_linear(sum, range, 100_000)


def test_steeper_work_fails() -> None:
    with pytest.raises(AssertionError, match=r"4 times the size took \d+ times as long"):
        assert_linear(lambda size: sum(range(size**4)), int, 32)


def test_repeated_texts() -> None:
    assert repeated("ab", "[", "]")(7) == "[ababab]"
