"""What a machine broke into: which blocks still hang together, how they moved, where they ended."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from agentflow.env.feedback.text import number, point_text
from agentflow.env.rollout import Array, Flags, Trace
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
    """Blocks that came off together. World frame; kg, m, s."""

    blocks: tuple[int, ...]
    mass: float
    time: float
    """When the last connection to the other blocks was lost; 0 if the machine was settling."""
    velocity: Vec3
    """Of its centre of mass then."""
    end: Vec3
    """Its centre of mass at the end."""


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
    found = [
        _fragment(machine, trace, blocks)
        for blocks in _groups(len(machine), left)
        if blocks not in whole
    ]
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
    rest = others[len(heavy) :]
    if rest:
        told.append(f"{len(rest)} more, {number(sum(each.mass for each in rest), 1)} kg in all")
    head = "Fragments (blocks: mass, velocity in m/s as it came off, where it ended)"
    return [f"{head}: {'; '.join(told)}"]


def _text(item: Fragment) -> str:
    moved = f"{point_text(item.velocity, 1)} at {number(item.time)} s"
    return f"{ranges(item.blocks)}: {number(item.mass, 1)} kg, {moved}, {point_text(item.end, 1)}"
