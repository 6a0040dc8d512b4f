"""What is connected with what, and in which order the blocks of a machine can be put on.

The root comes first. A block comes after those that it is attached to, and slides onto its face
along the normal, from outside the machine: what its box would pass through has to come later. Boxes
meet as `overlapping` has it, so a container does not hinder its direct child. Two-ended blocks span
gaps that others slide through, so they come last, and nothing hinders them.
"""

from collections import Counter
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from heapq import heappop, heappush
from itertools import pairwise
from typing import NamedTuple

from agentflow.machine.blocks.library import library
from agentflow.machine.blocks.types import DIRECTIONS
from agentflow.machine.geometry.mobility import JAMMED, Sets, find_loops, lock
from agentflow.machine.geometry.placement import Geometry, overlapping
from agentflow.machine.geometry.pose import Placed
from agentflow.machine.geometry.vectors import Vec3
from agentflow.machine.problems import Problem


class Bond(NamedTuple):
    """A connection of two ends. Ends are numbered: 2 x block, and 1 more for the second end."""

    block: int
    a: int
    b: int
    kind: str = "fixed"
    """`JointType.kind`."""
    pivot: Vec3 = (0.0, 0.0, 0.0)
    """Of a moving joint, machine frame, m."""
    axis: Vec3 = (0.0, 0.0, 1.0)


def parent_bonds(geometry: Geometry) -> Iterator[Bond]:
    """The joint of each block to its parent; boulders, which lie loose, have none."""
    for placed in geometry.blocks:
        joint, parent = library()[placed.type].joint, placed.step.parent
        if parent >= 0 and joint.kind != "loose":
            ends = 2 * parent, 2 * placed.id
            if joint.moves:
                axis = placed.orientation.turn(DIRECTIONS[joint.axis])
                x, y, z = map(float, axis)
                yield Bond(placed.id, *ends, joint.kind, placed.origin, (x, y, z))
            else:
                yield Bond(placed.id, *ends)


def extra_bonds(geometry: Geometry) -> Iterator[Bond]:
    """Rigid connections other than to parents; `a` is of the other block, if there is one."""
    for placed in geometry.blocks:
        if placed.two_ended:
            yield Bond(placed.id, 2 * placed.step.parents[1], 2 * placed.id + 1)
            if library()[placed.type].connector == "rod":
                yield Bond(placed.id, 2 * placed.id, 2 * placed.id + 1)
    for link in geometry.auto_connections:
        yield Bond(link.block, 2 * link.partner, 2 * link.block)


def largest_piece(geometry: Geometry) -> int:
    """Number of parts (`BlockType.parts`) of the piece that has most, at any time.

    Engines need one more part for a moving joint that closes a loop. Before anything breaks, such
    joints may be fewer than the moving joints in loops, or than the loops, which are counted here.
    """
    bonds = [*parent_bonds(geometry), *extra_bonds(geometry)]
    sets = Sets()
    parts: Counter[int] = Counter()
    for bond in bonds:
        sets.join(bond.a, bond.b)
    for placed in geometry.blocks:
        if placed.two_ended:
            parts.update(sets.find(2 * placed.id + end) for end in (0, 1))
        else:
            parts[sets.find(2 * placed.id)] += library()[placed.type].parts
    loops = list(find_loops(bonds, range(len(bonds)), lambda end: end))
    count = Counter(sets.find(bonds[loop[0][0]].a) for loop in loops)
    involved = {i for loop in loops for i, _ in loop if bonds[i].kind != "fixed"}
    moving = Counter(sets.find(bonds[i].a) for i in involved)
    return max(total + min(count[piece], moving[piece]) for piece, total in parts.items())


def locked_joints(geometry: Geometry) -> list[Problem]:
    """One warning (`locked`) for each block of a file-valid machine whose joint cannot move."""
    sets = Sets()
    joints: list[Bond] = []
    for bond in parent_bonds(geometry):
        if bond.kind == "fixed":
            sets.join(bond.a, bond.b)
        else:
            joints.append(bond)
    found = []
    for bridge in extra_bonds(geometry):
        for joint in _within(sets, joints) if sets.join(bridge.a, bridge.b) else ():
            joints.remove(joint)
            blocks = tuple(sorted({joint.block, bridge.block}))
            found.append(_warning(geometry, joint, blocks, _bridges(geometry, bridge)))
    lock(joints, range(len(joints)), sets)
    found += [_warning(geometry, joint, (joint.block,), JAMMED) for joint in _within(sets, joints)]
    return sorted(found, key=lambda problem: problem.blocks)


def _within(sets: Sets, joints: list[Bond]) -> list[Bond]:
    """The joints within one cluster."""
    return [joint for joint in joints if sets.find(joint.a) == sets.find(joint.b)]


def _bridges(geometry: Geometry, bridge: Bond) -> str:
    holder = geometry[bridge.block]
    if holder.two_ended:
        return f"{holder.label} bridges it"
    return f"the front of {holder.label} also connects to {geometry[bridge.a // 2].label}"


def _warning(geometry: Geometry, joint: Bond, blocks: tuple[int, ...], reason: str) -> Problem:
    text = f"the moving joint of {geometry[joint.block].label} cannot move: {reason}"
    return Problem("locked", blocks, text)


UNBUILDABLE = "unbuildable"


def build_order(geometry: Geometry) -> tuple[int, ...] | Problem:
    """Ids in an order in which all blocks can be put on; a problem if there is none.

    Where several exist, it is the one that keeps closest to the order of ids. Each rule says that
    one block comes before another, so there is an order unless blocks wait for each other in a
    circle.
    """
    sorter: TopologicalSorter[int] = TopologicalSorter()
    for placed in geometry.blocks:
        sorter.add(placed.id, *placed.step.parents)
        for other in _in_the_way(placed, geometry):
            sorter.add(other, placed.id)
    try:
        sorter.prepare()
    except CycleError as error:
        return _jam(geometry, error.args[1])
    ready: list[tuple[bool, int]] = []
    order: list[int] = []
    while sorter.is_active():
        for block in sorter.get_ready():
            heappush(ready, (geometry[block].two_ended, block))
        order.append(heappop(ready)[1])
        sorter.done(order[-1])
    return tuple(order)


def _in_the_way(placed: Placed, geometry: Geometry) -> Iterator[int]:
    """The blocks that a block would pass through as it slides onto its face."""
    if placed.step.parent < 0 or placed.two_ended:
        return
    front = placed.orientation.front
    ends = zip(front, placed.lo, placed.hi, geometry.lo, geometry.hi, strict=True)
    reach = [(min(a, p) if f < 0 else a, max(b, q) if f > 0 else b) for f, a, b, p, q in ends]
    (x0, x1), (y0, y1), (z0, z1) = reach
    path = placed._replace(lo=(x0, y0, z0), hi=(x1, y1, z1))
    for other in geometry.blocks:
        if other.id != placed.id and overlapping((path, other)):
            yield other.id


def _jam(geometry: Geometry, circle: list[int]) -> Problem:
    """The problem of blocks each of which has to be put on before the next, in a circle."""
    steps = [(a, b, a in geometry[b].step.parents) for a, b in pairwise(circle)]
    last = max(i for i, (_, _, carries) in enumerate(steps) if not carries)
    carrier, told = steps[last][1], []
    for block, other, carries in steps[last + 1 :] + steps[: last + 1]:
        if not carries:
            told.append(f"{geometry[other].label} is in the way of {geometry[block].label}")
            if carrier != block:
                told[-1] += f", which {'it' if carrier == other else f'block {carrier}'} carries"
            carrier = other
    message = f"the machine cannot be built in any order: {', and '.join(told)}; move one of them"
    return Problem(UNBUILDABLE, tuple(sorted(set(circle))), message)
