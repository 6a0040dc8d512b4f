"""Broken connections and the highest loads, as force and moment."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

from agentflow.env.feedback.text import block_name, number, vector_text
from agentflow.env.measurements import Peak
from agentflow.env.rollout import Broken, Moment
from agentflow.machine.tree import Machine

MAX_LINES = 5
"""Most breakages that get their own line of text; the data holds all."""
TELLING, TELLING_AFTER, LEAST = 0.3, 0.5, 0.05
"""Load over strength above which peaks up to the decisive moment are told, those after it, and the
highest one in any case."""
_SETTLING = " (while it settled, before t = 0)"


def broken_lines(machine: Machine, broken: Sequence[Broken]) -> list[str]:
    """The connections that broke, in order of time."""
    if not broken:
        return ["Broken: none"]
    lines = [
        f"Broken: {block_name(machine, item.block)} off block {item.partner} at "
        f"{number(item.time)} s{_SETTLING if item.time < 0.0 else ''}, load {number(item.load)} "
        f"(force, moment: {_wrench_text(item)})"
        for item in broken[:MAX_LINES]
    ]
    rest = broken[MAX_LINES:]
    if rest:
        names = ", ".join(f"{item.block} off {item.partner}" for item in rest)
        lines.append(f"Broken later: {names}")
    return lines


def load_lines(peaks: Sequence[Peak], moment: Moment | None) -> list[str]:
    """The connections that held with the highest loads, up to and after the decisive moment."""
    lines: list[str] = []
    for after, group in groupby(peaks, key=lambda peak: peak.after):
        found = [peak for peak in group if peak.load < 1.0]
        least = TELLING_AFTER if after else TELLING
        told = [peak for peak in found if peak.load >= least] or found[: not after]
        when = f" {'after' if after else 'up to'} {moment.name}" if moment else ""
        if told and told[0].load >= LEAST:
            parts = "; ".join(map(_peak_text, told))
            note = "" if lines else " (share of strength: force N, moment N m; breaks at 1)"
            lines.append(f"Highest loads{when}{note}: {parts}")
    return lines


def _peak_text(peak: Peak) -> str:
    return (
        f"{peak.block}-{peak.partner} {number(peak.load)} at {number(peak.time)} s: "
        + _wrench_text(peak)
    )


def _wrench_text(item: Peak | Broken) -> str:
    return f"{vector_text(item.force)}, {vector_text(item.moment)}"
