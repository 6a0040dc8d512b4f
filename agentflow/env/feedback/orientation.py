"""How the root is turned over time, in words, and where the machine frame is in the world."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from itertools import groupby
from math import acos, asin, degrees
from typing import TypeVar

from agentflow.env.feedback.text import block_name, main_axis, number, point_text
from agentflow.env.joints import joint_angle, turns
from agentflow.env.rollout import Array, Trace
from agentflow.env.rotations import rotate
from agentflow.machine.blocks.library import library
from agentflow.machine.geometry.placement import place
from agentflow.machine.geometry.vectors import rotate_vector, subtract
from agentflow.machine.tree import Machine

V = TypeVar("V")
TURNED = 1.0
"""Least rotation at t = 0 that is reported, degrees."""
SETTLED, MOST_SETTLED = 3.0, 3
"""Least angle of a joint at t = 0 that is reported, degrees, and most joints."""


def orientation_runs(trace: Trace) -> list[tuple[str, float, float]]:
    """Periods in which the root roughly faces one axis: (text, start, end), in seconds.

    The text names the axis that its Front faces and, unless its top points up, that of its top.
    The trace is evenly sampled.
    """
    turn = trace.rotation[:, 0]
    fronts, tops = rotate(turn, (0.0, 0.0, 1.0)), rotate(turn, (0.0, 1.0, 0.0))
    words = [
        main_axis(front) + ("" if (up := main_axis(top)) == "y+" else f" with its top towards {up}")
        for front, top in zip(fronts.tolist(), tops.tolist(), strict=True)
    ]
    return list(find_runs(words, trace.times))


def find_runs(values: Sequence[V], times: Array) -> Iterator[tuple[V, float, float]]:
    """Each run of equal values with the times of its first and last sample, s."""
    for value, group in groupby(range(len(values)), key=values.__getitem__):
        members = list(group)
        yield value, float(times[members[0]]), float(times[members[-1]])


def orientation_text(runs: Sequence[tuple[str, float, float]], interval: float) -> str:
    """The runs in words; shares of the time if there are many."""
    if len(runs) == 1:
        return f"facing {runs[0][0]} all the time"
    if len(runs) <= 4:
        return "facing " + "; ".join(
            f"{word} " + (f"from {start:.1f} to {end:.1f} s" if end > start else f"at {end:.1f} s")
            for word, start, end in runs
        )
    held: dict[str, float] = defaultdict(float)
    for word, start, end in runs:
        held[word] += end - start + interval
    total = sum(held.values())
    shares = [
        f"{word} {time / total:.0%}"
        for word, time in sorted(held.items(), key=lambda item: -item[1])[:4]
    ]
    return f"changes {len(runs) - 1} times, facing " + "; ".join(
        [f"{shares[0]} of the time", *shares[1:]]
    )


def frame_text(machine: Machine, trace: Trace) -> str:
    """Where the frame in which designers know the machine is in the world at t = 0.

    Its origin is below the root's centre, at the height of the machine's lowest corner.
    """
    x, y, z, w = trace.rotation[0, 0].tolist()
    at = rotate_vector((x, y, z, w), (0.0, -place(machine).box_min[1], 0.0))
    px, py, pz = trace.centre[0, 0].tolist()
    shift = point_text(subtract((px, py, pz), at))
    angle = degrees(2.0 * acos(min(1.0, abs(w))))
    if angle < TURNED:
        return f"at t = 0 world = machine frame + {shift}"
    about = main_axis((x, y, z) if w > 0.0 else (-x, -y, -z))
    turned = f"turned by {number(angle, 1)} degrees about {about}"
    return f"at t = 0 world = machine frame {turned} + {shift}"


def settled_lines(machine: Machine, trace: Trace) -> list[str]:
    """Where joints that swing, such as the hinge of an arm, came to rest before t = 0; [] if all
    are as built. Joints about a block's Front are left out: wheels look the same at every angle."""
    told, start = [], trace[:1]
    for step in machine:
        if not turns(machine, step.id) or library()[step.type].joint.axis == "Front":
            continue
        angle = degrees(abs(float(joint_angle(machine, start, step.id)[0])))
        if angle >= SETTLED:
            front = float(rotate(trace.rotation[0, step.id], (0.0, 0.0, 1.0))[1])
            rise = degrees(asin(min(1.0, max(-1.0, front))))
            told.append(
                f"{block_name(machine, step.id)} has swung {number(angle, 0)} degrees, its "
                f"Front {number(abs(rise), 0)} degrees {'above' if rise > 0.0 else 'below'} level"
            )
    return [f"Joints at t = 0: {'; '.join(told[:MOST_SETTLED])}"] if told else []
