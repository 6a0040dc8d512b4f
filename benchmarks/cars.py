"""The 20-block car used to measure the speed of physics."""

from __future__ import annotations

from agentflow.machine.tree import Machine, Step

_ROWS = (
    *((0, -1, -1), (1, 0, 0), (1, 0, 1), (2, 1, 1), (2, 1, 3), (2, 2, 1), (2, 2, 3)),
    *((63, 0, 4), (1, 7, 0), (15, 8, 0), (15, 7, 7), (15, 7, 8), (15, 7, 9)),
    *((15, 7, 10), (15, 7, 11), (15, 7, 12), (1, 7, 3), (1, 7, 6), (35, 16, 0), (35, 17, 0)),
)
CAR = Machine(tuple(Step(i, *row) for i, row in enumerate(_ROWS)))
"""Four powered wheels under a tower."""
