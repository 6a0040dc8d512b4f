"""In which order the blocks of a machine can be put on, one after the other.

The root comes first. A block comes after those that it is attached to, and slides onto its face
along the normal, from outside the machine: what its box would pass through has to come later. Boxes
meet as `overlapping` has it, so a container does not hinder its direct child. Two-ended blocks span
gaps that others slide through, so they come last, and nothing hinders them.
"""

from __future__ import annotations

from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from heapq import heappop, heappush
from itertools import pairwise

from agentflow.machine.geometry.placement import Geometry, overlapping
from agentflow.machine.geometry.pose import Placed
from agentflow.machine.problems import Problem

UNBUILDABLE = "unbuildable"
"""Code of a machine that cannot be built in any order."""


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
