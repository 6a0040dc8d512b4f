"""Numbers as people read them: on the terminal, in tables and on pages. Imports almost nothing."""

from __future__ import annotations

from collections.abc import Sequence

NOTHING = "-"
"""Shown where there is no value."""


def number(value: float | None, digits: int = 2) -> str:
    """A number with so many decimals, by default those of a score."""
    return NOTHING if value is None else f"{value:.{digits}f}"


def change(value: float | None, digits: int = 2) -> str:
    """A difference, with its sign."""
    return NOTHING if value is None else f"{value:+.{digits}f}"


def percent(share: float | None, digits: int = 1) -> str:
    """A share in percent."""
    return NOTHING if share is None else f"{share:.{digits}%}"


def money(value: float | None, unknown: str = NOTHING) -> str:
    """An amount of money, in the currency of the prices."""
    return unknown if value is None else f"{value:.4g}"


def extents(size: Sequence[float]) -> str:
    """The size of a box: "1 x 0.5 x 2"."""
    return " x ".join(f"{extent:g}" for extent in size)


def counted(count: int, noun: str) -> str:
    """A count with its noun: "1 run", "2 runs"."""
    return f"{count} {noun}{'' if count == 1 else 's'}"


def duration(seconds: float) -> str:
    """A length of time that was estimated: `8 s`, `2.5 min`, `3.0 h`; at least one second."""
    if seconds < 60:
        return f"{max(seconds, 1):.0f} s"
    return f"{seconds / 60:.1f} min" if seconds < 3600 else f"{seconds / 3600:.1f} h"


def block_count(count: int, most: int | None) -> str:
    """The blocks of a machine, and the most that its task allows: "23 of 40 blocks"."""
    return f"{count} blocks" if most is None else f"{count} of {most} blocks"


def interval_text(
    ends: Sequence[float] | None, digits: int = 2, *, in_percent: bool = False
) -> str | None:
    """An interval, "1.20 - 3.40"; None without one."""
    show = percent if in_percent else number
    return None if ends is None else " - ".join(show(end, digits) for end in ends)


def cell_text(value: object, digits: int = 2, *, in_percent: bool = False) -> str:
    """A cell of a table: floats and intervals with a few decimals, a dash for no value."""
    if value is None or isinstance(value, float):
        return percent(value, digits) if in_percent else number(value, digits)
    if isinstance(value, tuple):
        return interval_text(value, digits, in_percent=in_percent) or NOTHING
    return str(value)
