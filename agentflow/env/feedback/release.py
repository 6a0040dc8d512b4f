"""The release line: how something leaves the machine, or the machine the ground."""

from __future__ import annotations

from math import atan2, degrees, hypot
from typing import Any

import numpy as np

from agentflow.env.feedback.text import body_name, main_axis, number
from agentflow.env.rollout import Array, Moment, Trace
from agentflow.env.rotations import compose, conjugate
from agentflow.machine.blocks.library import library
from agentflow.machine.tree import Machine

SIDEWAYS = 2.0
"""Least angle between the horizontal direction and z+ that is reported, degrees."""
MOST_LENGTHS = 4
"""Most different lengths of springs that are listed one by one."""
SQUARE = 45.0
"""Angle to z+ from which on the nearest axis is reported instead, degrees."""
PULLING = ("spring", "rope")


def describe_release(
    machine: Machine, trace: Trace, moment: Moment | None, velocity: Array, what: str = ""
) -> tuple[list[str], dict[str, Any]]:
    """A line with speed, elevation, angle and turning rate of the arm, and lengths of springs, and
    as data (`release`) speed, m/s, and elevation, degrees; without a release, no line and None.

    Args:
        machine: The simulated machine.
        trace: Its trace.
        moment: The release.
        velocity: (T, 3) of what is released.
        what: Of what the moment is, such as " of the root's fragment".
    """
    if moment is None:
        return [], {"release": None}
    index = sample_at(trace, moment.time)
    x, y, z = velocity[index].tolist()
    level = hypot(x, z)
    speed, elevation = hypot(x, y, z), degrees(atan2(y, level))
    parts = [f"speed {number(speed, 1)} m/s", f"elevation {number(elevation, 0)} degrees"]
    aside = degrees(atan2(x, z))
    if level > 0.5 and abs(aside) > SQUARE:
        parts.append(f"towards {main_axis((x, 0.0, z))}")
    elif level > 0.5 and abs(aside) > SIDEWAYS:
        side = "x+" if x > 0 else "x-"
        parts.append(f"{number(abs(aside), 0)} degrees from z+ towards {side}")
    if moment.holder is not None:
        held = max(index - int(trace.times[index] > moment.time + 1e-6), 0)
        parts.append(_arm_text(machine, trace, moment.holder, held))
    parts += _lengths(machine, trace, index)
    line = f"{moment.name.capitalize()}{what} at {number(moment.time)} s: {', '.join(parts)}"
    return [line], {"release": {"speed": speed, "elevation": elevation}}


def sample_at(trace: Trace, time: float) -> int:
    """The first sample at or after a time, s, else the last."""
    return min(int(np.searchsorted(trace.times, time - 1e-6)), len(trace.times) - 1)


def _arm_text(machine: Machine, trace: Trace, block: int, index: int) -> str:
    turns = trace.rotation[:, block]
    *axis, w = compose(turns[index], conjugate(turns[0][None])[0]).tolist()
    angle = degrees(2.0 * atan2(hypot(*axis), abs(w)))
    rate = float(np.linalg.norm(trace.angular_velocity[index, block]))
    name = body_name(machine, block)
    return f"{name} has turned {number(angle, 0)} degrees, now at {number(rate, 1)} rad/s"


def _lengths(machine: Machine, trace: Trace, index: int) -> list[str]:
    """Lengths of springs and winches at t = 0 and now, which tell the work of each by its law;
    equal ones together."""
    found: dict[tuple[str, str], list[int]] = {}
    for column, block in enumerate(trace.linear):
        connector = library()[machine[block].type].connector
        if connector in PULLING and trace.alive[index, block]:
            first, now = (number(trace.length[row, column], 1) for row in (0, index))
            found.setdefault((now, first), []).append(block)
    if not found:
        return []
    rows = sorted(found, key=lambda pair: tuple(map(float, pair)))
    texts = [
        f"{first} to {now} m ({', '.join(map(str, found[now, first]))})" for now, first in rows
    ]
    if len(texts) > MOST_LENGTHS:
        nows, firsts = (sorted(column, key=float) for column in zip(*rows, strict=True))
        texts = [f"{firsts[0]}-{firsts[-1]} to {nows[0]}-{nows[-1]} m"]
    return [f"lengths of springs since t = 0: {', '.join(texts)}"]
