"""Words and numbers of feedback, and its lines about orientation, flight and steering."""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from math import acos, asin, degrees, hypot
from typing import Any, TypeVar

import numpy as np

from agentflow.env.constants import constants
from agentflow.env.measurements import Named
from agentflow.env.rollout import Array, Trace
from agentflow.env.rotations import joint_angle, rotate, turns
from agentflow.machine.blocks.library import STEERING, library
from agentflow.machine.geometry.placement import place
from agentflow.machine.geometry.vectors import rotate_vector, subtract
from agentflow.machine.tree import Machine

MAX_SAMPLES = 11
"""Most samples of a series; queries return more."""
AXES = ("x+", "x-", "y+", "y-", "z+", "z-")


@dataclass(frozen=True)
class Series:
    """Positions over time, thinned to at most 11 samples."""

    label: str
    times: list[float]
    values: list[list[float]]

    @property
    def text(self) -> str:
        """One line: label, interval, start and the points in brackets."""
        return f"{self._head} (x, y, z): {' '.join(map(point_text, self.values))}"

    @property
    def _head(self) -> str:
        return f"{self.label} every {spacing(self.times):.3g} s from t = {self.times[0]:.3g} s"


@dataclass(frozen=True)
class Angles(Series):
    """One angle over time, thinned alike."""

    @property
    def text(self) -> str:
        """One line with whole degrees."""
        return f"{self._head}: {' '.join(number(angle, 0) for (angle,) in self.values)}"


def spacing(times: Sequence[float] | Array) -> float:
    """Time between even samples, s; the default interval if there is only one sample."""
    return float(times[1] - times[0]) if len(times) > 1 else constants()["sample_interval"]


def number(value: float, digits: int = 2) -> str:
    """Format with fixed decimals; never "-0.00"."""
    return f"{round(float(value), digits) + 0.0:.{digits}f}"


def rounded(value: float) -> str:
    """Format with three significant digits; never "-0"."""
    short = float(f"{value:.3g}")
    return f"{short + 0.0:g}" if abs(value) < 1e3 else f"{short:.0f}"


def point_text(point: Iterable[float], digits: int = 2) -> str:
    """Format a position: "(0.00, 1.50, 3.00)"."""
    return f"({', '.join(number(value, digits) for value in point)})"


def vector_text(vector: Sequence[float]) -> str:
    """Size and main direction: "3200 y-"."""
    return f"{rounded(hypot(*vector))} {main_axis(vector)}"


def main_axis(vector: Sequence[float]) -> str:
    """The axis nearest to a vector: "y-"."""
    index = max(range(3), key=lambda i: abs(vector[i]))
    return AXES[2 * index + (vector[index] < 0)]


def object_label(name: str) -> str:
    """An object of the scene in a sentence: "the far wall", "wall 1", "ring 2"."""
    whole = name.partition(",")[0]
    return whole if whole[-1].isdigit() else f"the {whole}"


def term_number(terms: Mapping[str, Any], name: str) -> float:
    """A term of a verdict; 0 if it does not apply."""
    return float(terms.get(name) or 0.0)


def block_name(machine: Machine, block: int) -> str:
    """Id and type of a block: "block 8 (Wooden Block)"."""
    return f"block {block} ({library()[machine[block].type].name})"


def body_name(machine: Machine, body: Named) -> str:
    """A block or object in a sentence."""
    return object_label(body) if isinstance(body, str) else block_name(machine, body)


def sample_indices(count: int) -> range:
    """At most 11 evenly spaced indices into `count` samples, starting at 0."""
    return range(0, count, max(1, -(-(count - 1) // (MAX_SAMPLES - 1))))


def series(label: str, times: Array, values: Array) -> Series:
    """Thin out (T,) even times and (T, K) values to a series."""
    picks = sample_indices(len(times))
    return Series(label, times[picks].tolist(), values[picks].tolist())


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
    most = sorted(held.items(), key=lambda item: -item[1])[:4]
    first, *others = (f"{word} {time / total:.0%}" for word, time in most)
    told = "; ".join([f"{first} of the time", *others])
    return f"changes {len(runs) - 1} times, facing {told}"


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


SHARES = (0.1, 0.5, 1.0)
"""When to report forces, as shares of the recorded time."""


def flight_lines(machine: Machine, trace: Trace) -> list[str]:
    """Weight, and at three times the vertical force, drag, speed and pitch.

    The vertical force is what blades and thrusters exert, and the wind where there is any: mass
    times acceleration plus weight and drag. The trace is evenly sampled.
    """
    if len(trace.times) < 3:
        return []
    kinds = [library()[step.type] for step in machine]
    masses = np.array([kind.mass for kind in kinds])
    resistance = masses * np.array([kind.linear_drag for kind in kinds])
    weight = masses.sum() * constants()["gravity"]
    velocity = (trace.velocity * masses[:, None]).sum(axis=1) / masses.sum()
    drag = (trace.velocity * resistance[:, None]).sum(axis=1)
    force = masses.sum() * np.gradient(velocity, trace.times, axis=0) + drag
    force[:, 1] += weight
    fronts = rotate(trace.rotation[:, 0], (0.0, 0.0, 1.0))
    texts = []
    for share in SHARES:
        index = min(round(share * (len(trace.times) - 1)), len(trace.times) - 2)
        texts.append(
            f"{trace.times[index]:.1f} s lift {rounded(force[index, 1])}, "
            f"drag {rounded(hypot(*drag[index]))}, climb {number(velocity[index, 1], 1)} m/s, "
            f"pitch {number(degrees(asin(np.clip(fronts[index, 1], -1.0, 1.0))), 0)}"
        )
    head = f"Flight (N; pitch of block 0's Front in degrees), weight {rounded(weight)}"
    return [f"{head}: {'; '.join(texts)}"]


MOST = 4
"""Most series; blocks that turn alike share one."""


def steering_angles(machine: Machine, trace: Trace) -> list[Angles]:
    """The angles of all steering blocks and hinges against their parents, degrees, from 0 as built.

    They are positive in the sense in which level 1 turns a block, and end where it breaks off.
    `trace` is evenly sampled.
    """
    picks = sample_indices(len(trace.times))
    times = trace.times[picks]
    alike: dict[tuple[str, ...], list[int]] = {}
    angles: dict[int, Array] = {}
    for block in (step.id for step in machine if step.type in STEERING):
        sense = library()[machine[block].type].joint.motor_sense
        turned = np.degrees(sense * joint_angle(machine, trace, block))
        angles[block] = turned[picks][trace.alive[picks, block]]
        if len(angles[block]):
            alike.setdefault(tuple(number(each, 0) for each in angles[block]), []).append(block)
    found = [
        Angles(
            f"Steering of {', '.join(map(str, blocks))} (deg, + at level 1)",
            times[: len(shown)].tolist(),
            angles[blocks[0]][:, None].tolist(),
        )
        for shown, blocks in alike.items()
    ]
    if hidden := sum(map(len, list(alike.values())[MOST:])):
        last = found[MOST - 1]
        found[MOST - 1] = replace(last, label=f"{last.label}, {hidden} more not shown,")
    return found[:MOST]
