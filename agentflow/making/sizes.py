"""How large a machine is made, and with which pegs."""

from __future__ import annotations

import re
from dataclasses import dataclass

from agentflow.errors import UsageError

PRINTED, FULL = 20.0, 1.0
"""Scales by default, 1 : N: of files for printers, and of others."""
LEAST, MOST = 1.0, 1000.0
THICKEST = 100.0
"""Thickest peg, mm."""


@dataclass(frozen=True)
class Making:
    """What was asked for; None and False stand for what is usual in a format."""

    scale: float | None = None
    """N of 1 : N."""
    pegs: float | None = None
    """Diameter of the pegs, mm: parts get pegs where they are attached, and holes for them."""
    parts: bool = False
    """Whether each block is a part of its own; pegs need that."""

    def millimetres(self, usual: float) -> float:
        """mm of the made machine per m, with the scale that is usual in a format."""
        return 1000.0 / (self.scale or usual)


USUAL = Making()


def making(scale: float | None = None, pegs: str | None = None, *, parts: bool = False) -> Making:
    """What options ask for.

    Raises:
        UsageError: The scale or the pegs are none.
    """
    if scale is not None and not LEAST <= scale <= MOST:
        raise UsageError(
            f"--scale {scale:g} is no scale: give a number from {LEAST:g} to {MOST:g}, such as "
            f"{PRINTED:g} for 1 : {PRINTED:g}"
        )
    if pegs is None:
        return Making(scale, parts=parts)
    found = re.fullmatch(r"(\d+(?:\.\d*)?|\.\d+)\s*(?:mm)?", pegs.strip())
    if found is None or not 0.0 < float(found[1]) <= THICKEST:
        raise UsageError(
            f"--pegs {pegs!r} is no diameter: give millimetres up to {THICKEST:g}, such as 5mm"
        )
    return Making(scale, float(found[1]), parts=True)
