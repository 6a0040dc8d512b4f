"""Tests over many values name those that fail."""

from __future__ import annotations

import pytest

from tests.loops import for_each


def test_all_values_are_tried_and_those_that_fail_named() -> None:
    tried = []

    @for_each(["a", ("b", 2), ("c", 3), "d"])
    def letters(letter: str, number: int = 0) -> None:
        tried.append(letter)
        assert number < 2, f"{number} is too much"

    with pytest.raises(AssertionError, match=r"^fails for \('b', 2\), \('c', 3\): 2 is too much"):
        letters()
    assert tried == ["a", "b", "c", "d"]


def test_other_errors_are_raised_as_they_are() -> None:
    with pytest.raises(ZeroDivisionError):
        for_each([1, 0])(lambda number: print(1 / number))()
