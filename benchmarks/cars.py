"""Machines that several benchmarks simulate."""

from __future__ import annotations

from agentflow.machine.tree import Machine, Step

_CAR = ((0, -1, -1), (1, 0, 0), (1, 0, 1), (2, 1, 1), (2, 1, 3), (2, 2, 1), (2, 2, 3))
_TOWER = (
    *((63, 0, 4), (1, 7, 0), (15, 8, 0), (15, 7, 7), (15, 7, 8), (15, 7, 9)),
    *((15, 7, 10), (15, 7, 11), (15, 7, 12), (1, 7, 3), (1, 7, 6), (35, 16, 0), (35, 17, 0)),
)
_CATAPULT = (
    *((0, -1, -1), (1, 0, 1), (1, 0, 2), (1, 0, 0), (1, 1, 2), (1, 2, 4), (1, 0, 3), (1, 6, 6)),
    *((1, 7, 6), (15, 8, 0), (22, 8, 4), (63, 10, 3), (30, 11, 0), (36, 12, 0), (35, 10, 0)),
)
"""(type, parent, face) of each block."""


def _build(rows: tuple[tuple[int, int, int], ...]) -> Machine:
    return Machine(tuple(Step(index, *row) for index, row in enumerate(rows)))


PLAIN_CAR = _build(_CAR)
"""The root, a wooden block at its front and back, and two powered wheels on each."""
CAR = _build(_CAR + _TOWER)
"""The plain car under a tower: 20 blocks."""
CATAPULT = _build(_CATAPULT)
