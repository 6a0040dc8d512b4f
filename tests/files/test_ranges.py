"""Ranges of numbers in YAML files."""

from __future__ import annotations

from random import Random

from agentflow.files.ranges import draw_numbers, ends_of


def test_ranges_are_known_by_their_ends() -> None:
    assert ends_of("2..5") == ("2", "5")
    assert ends_of("-0.3..-0.05") == ("-0.3", "-0.05")
    assert [*map(ends_of, ("2...5", "2..", "a..b", "throwing/2", 2, None))] == [None] * 6


def test_numbers_take_the_place_of_ranges_wherever_they_stand() -> None:
    data = {"whole": "-2..2", "exact": "1.0..2.0", "list": ["3..3", "text"], "as it is": True}
    drawn = [draw_numbers(data, Random(seed)) for seed in range(50)]
    assert {each["whole"] for each in drawn} == {-2, -1, 0, 1, 2}
    exact = [each["exact"] for each in drawn]
    assert 1.0 <= min(exact) < 1.1 < 1.9 < max(exact) <= 2.0
    assert all(number == float(f"{number:.3g}") for number in exact)
    assert all(each["list"] == [3, "text"] and each["as it is"] is True for each in drawn)
    assert data["whole"] == "-2..2"
    assert drawn[0] == draw_numbers(data, Random(0))
