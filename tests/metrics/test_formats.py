"""Numbers as people read them."""

from __future__ import annotations

from agentflow.metrics.tables import (
    block_count,
    change,
    counted,
    duration,
    extents,
    interval_text,
    money,
    number,
    percent,
)


def test_a_missing_number_is_a_dash() -> None:
    shown = (number(None), change(None), percent(None), money(None), money(None, "unknown"))
    assert shown == ("-", "-", "-", "-", "unknown")
    assert interval_text(None) is None


def test_numbers_have_the_wanted_decimals() -> None:
    assert (number(1), number(2.345, 1)) == ("1.00", "2.3")
    assert (change(0.5), change(-0.0625, 3)) == ("+0.50", "-0.062")
    assert (percent(0.125), percent(0.125, 0)) == ("12.5%", "12%")
    assert (money(12.34567), extents([1.0, 0.5, 2.0])) == ("12.35", "1 x 0.5 x 2")
    assert interval_text((0.1, 0.25)) == "0.10 - 0.25"
    assert interval_text((0.1, 0.25), 1, in_percent=True) == "10.0% - 25.0%"


def test_counts_agree_with_their_noun() -> None:
    assert [counted(count, "run") for count in (0, 1, 2)] == ["0 runs", "1 run", "2 runs"]
    assert (block_count(23, None), block_count(23, 40)) == ("23 blocks", "23 of 40 blocks")


def test_estimated_times_have_the_unit_that_fits() -> None:
    shown = [duration(seconds) for seconds in (0.02, 59.4, 60, 3599, 5400)]
    assert shown == ["1 s", "59 s", "1.0 min", "60.0 min", "1.5 h"]
