"""What separates: what a machine broke into, and how something leaves the machine, or the machine
the ground."""

from collections import defaultdict
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from math import atan2, degrees, hypot
from typing import Any

import numpy as np

from agentflow.env.feedback.text import body_name, main_axis, number, point_text
from agentflow.env.rollout import Array, Flags, Moment, Trace
from agentflow.env.rotations import compose, conjugate
from agentflow.machine.blocks.library import library
from agentflow.machine.description.geometry_info import ranges
from agentflow.machine.geometry.mobility import Sets
from agentflow.machine.geometry.vectors import Vec3
from agentflow.machine.tree import Machine

Pairs = Collection[tuple[int, int]]
MOST_FRAGMENTS, LEAST_MASS = 3, 0.5
"""Most fragments that are listed one by one: that of the root, and the heaviest, if they have at
least this mass, kg."""


@dataclass(frozen=True)
class Fragment:
    """Blocks that came off together. World frame; kg, m, s.

    `time` is when the last connection to the other blocks was lost, 0 if the machine was settling;
    `velocity` is that of its centre of mass then, and `end` is its centre of mass at the end.
    """

    blocks: tuple[int, ...]
    mass: float
    time: float
    velocity: Vec3
    end: Vec3


def held_pairs(trace: Trace, index: int) -> set[tuple[int, int]]:
    """The connections that hold in one sample; nothing reports the load of one that is lost."""
    holds = ~np.isnan(trace.utilisation[index])
    return {pair for pair, held in zip(trace.connections, holds, strict=True) if held}


def joined_to(block: int, pairs: Pairs) -> set[int]:
    """The blocks that hang together with one."""
    sets = _join(pairs)
    return {block} | {b for pair in pairs for b in pair if sets.find(b) == sets.find(block)}


def _join(pairs: Pairs) -> Sets:
    sets = Sets()
    for pair in pairs:
        sets.join(*pair)
    return sets


def _groups(count: int, pairs: Pairs) -> list[list[int]]:
    """All of so many blocks, in groups that hang together."""
    sets, groups = _join(pairs), defaultdict(list)
    for block in range(count):
        groups[sets.find(block)].append(block)
    return list(groups.values())


def root_velocity(machine: Machine, trace: Trace) -> Array:
    """(T, 3) velocity of the centre of mass of the blocks that hang together with the root in each
    sample, m/s; of all blocks as long as nothing has come off."""
    velocity = np.empty((len(trace.times), 3))
    for rows, blocks in root_states(machine, trace):
        velocity[rows] = _centre(machine, trace.velocity[rows], blocks)
    return velocity


def root_states(machine: Machine, trace: Trace) -> Iterator[tuple[Flags, list[int]]]:
    """(T,) which samples, and the blocks that hang together with the root in them; all blocks as
    long as nothing has come off those."""
    lost = np.isnan(trace.utilisation)
    for state in np.unique(lost, axis=0):
        rows: Flags = (lost == state).all(axis=1)
        yield rows, _with_root(machine, trace, int(rows.argmax()))


def is_root_alone(machine: Machine, trace: Trace, index: int) -> bool:
    """Whether blocks have come off those that hang together with the root, in one sample."""
    return len(_with_root(machine, trace, index)) < len(machine)


def _with_root(machine: Machine, trace: Trace, index: int) -> list[int]:
    left = joined_to(0, held_pairs(trace, index))
    whole = left == joined_to(0, trace.connections)
    return list(range(len(machine))) if whole else sorted(left)


def find_fragments(machine: Machine, trace: Trace) -> list[Fragment]:
    """What the machine broke into, with the root's first, then the heaviest; [] if it did not.

    Blocks that were never joined to others, such as a boulder in its container, are no fragments.
    """
    left = held_pairs(trace, -1)
    if len(left) == len({*trace.connections}):
        return []
    whole = _groups(len(machine), trace.connections)
    now = _groups(len(machine), left)
    found = [_fragment(machine, trace, blocks) for blocks in now if blocks not in whole]
    return sorted(found, key=lambda item: (0 not in item.blocks, -item.mass))


def _fragment(machine: Machine, trace: Trace, blocks: list[int]) -> Fragment:
    inside = np.isin(trace.connections, blocks)
    lost = np.isnan(trace.utilisation[:, inside[:, 0] != inside[:, 1]])
    index = int(lost.argmax(axis=0).max())
    return Fragment(
        tuple(blocks),
        float(_masses(machine, blocks).sum()),
        float(trace.times[index]),
        _vector(_centre(machine, trace.velocity[index], blocks)),
        _vector(_centre(machine, trace.centre[-1], blocks)),
    )


def _masses(machine: Machine, blocks: Collection[int]) -> Array:
    return np.array([library()[machine[block].type].mass for block in blocks])


def _centre(machine: Machine, values: Array, blocks: list[int]) -> Array:
    """(..., 3) mean of some blocks' (..., N, 3) values, weighted by their masses."""
    masses = _masses(machine, blocks)
    mean: Array = (values[..., blocks, :] * masses[:, None]).sum(axis=-2) / masses.sum()
    return mean


def _vector(values: Array) -> Vec3:
    x, y, z = values.tolist()
    return x, y, z


def fragment_lines(fragments: Sequence[Fragment]) -> list[str]:
    """One line; [] if nothing came off."""
    if not fragments:
        return []
    first, *others = fragments
    heavy = [each for each in others if each.mass >= LEAST_MASS][: MOST_FRAGMENTS - 1]
    told = [*map(_text, (first, *heavy))]
    if rest := others[len(heavy) :]:
        told.append(f"{len(rest)} more, {number(sum(each.mass for each in rest), 1)} kg in all")
    head = "Fragments (blocks: mass, velocity in m/s as it came off, where it ended)"
    return [f"{head}: {'; '.join(told)}"]


def _text(item: Fragment) -> str:
    moved = f"{point_text(item.velocity, 1)} at {number(item.time)} s"
    return f"{ranges(item.blocks)}: {number(item.mass, 1)} kg, {moved}, {point_text(item.end, 1)}"


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
    texts = [f"{was} to {now} m ({', '.join(map(str, found[now, was]))})" for now, was in rows]
    if len(texts) > MOST_LENGTHS:
        nows, firsts = (sorted(column, key=float) for column in zip(*rows, strict=True))
        texts = [f"{firsts[0]}-{firsts[-1]} to {nows[0]}-{nows[-1]} m"]
    return [f"lengths of springs since t = 0: {', '.join(texts)}"]
