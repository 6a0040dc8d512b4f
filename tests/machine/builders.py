"""Machines that several tests share."""

from __future__ import annotations

from agentflow.machine.tree import ROOT, Machine, Step

Spec = tuple[int, int, int] | tuple[int, int, int, int, int]


def build(*blocks: Spec) -> Machine:
    """Root plus blocks as (type, parent, face) or (type, parent_a, face_a, parent_b, face_b)."""
    steps = [ROOT]
    for index, (kind, *ends) in enumerate(blocks, 1):
        steps.append(Step(index, kind, *ends))
    return Machine(tuple(steps))


PUBLISHED_OVERLAP = build(
    (63, 0, 0), (63, 0, 1), (22, 1, 4), (22, 1, 2), (22, 2, 5), (22, 2, 5), (22, 1, 2)
)
"""The published example of overlaps: (4, 7) and (5, 6)."""

CATAPULT = build(
    (1, 0, 1),
    (1, 0, 2),
    (1, 0, 0),
    (1, 1, 2),
    (1, 2, 4),
    (1, 0, 3),
    (1, 6, 6),
    (1, 7, 6),
    (15, 8, 0),
    (22, 8, 4),
    (63, 10, 3),
    (30, 11, 0),
    (36, 12, 0),
)
"""The published catapult."""

CAR = build((1, 0, 0), (1, 0, 1), (2, 1, 1), (2, 1, 3), (2, 2, 1), (2, 2, 3))
"""A plain four-wheel car: wheels face x- and x+."""
