"""Owns how single values are written for a person. Imports nothing, so that it costs nothing."""

from __future__ import annotations


def number(value: float | None) -> str:
    """A score with two decimals; a dash where there is none."""
    return "-" if value is None else f"{value:.2f}"


def harmless(text: str, kept: str = "") -> str:
    """Text by others, without what a terminal would obey, but for the characters `kept`."""
    return "".join(c if c.isprintable() or c in kept else repr(c)[1:-1] for c in text)
