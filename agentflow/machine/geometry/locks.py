"""Owns the finding of joints that cannot move, as rigid connections bridge them (spec 2.2).

A rollout tells the same as an event; here it takes neither engine nor physics.
"""

from __future__ import annotations

from collections.abc import Iterator

from agentflow.machine.blocks.library import library
from agentflow.machine.geometry.placement import Geometry
from agentflow.machine.problems import Problem, block_label

Piece = tuple[int, int]
"""Block and which end of it: 0 is what its parent holds, 1 the second end of a two-ended block."""
Bond = tuple[Piece, Piece]


def locked_joints(geometry: Geometry) -> list[Problem]:
    """One warning (`locked`) for each block whose joint cannot move.

    Args:
        geometry: Of a file-valid machine.
    """
    groups = _Groups()
    joints = dict(_joints(geometry))
    for bond in _tree(geometry):
        groups.join(bond)
    found = []
    for bridge, holder in _bridges(geometry):
        groups.join(bridge)
        for block, bond in tuple(joints.items()):
            if groups.joined(bond):
                del joints[block]
                found.append(_warning(geometry, block, holder, bridge[0][0]))
    return sorted(found, key=lambda problem: problem.blocks)


def _joints(geometry: Geometry) -> Iterator[tuple[int, Bond]]:
    """What each moving joint holds together: its parent and itself."""
    for placed in geometry.blocks:
        if placed.step.parent >= 0 and library()[placed.type].joint.moves:
            yield placed.id, ((placed.step.parent, 0), (placed.id, 0))


def _tree(geometry: Geometry) -> Iterator[Bond]:
    """The rigid connections of blocks to their parents, first ends of two-ended blocks included."""
    for placed in geometry.blocks:
        if placed.step.parent >= 0 and library()[placed.type].joint.kind == "fixed":
            yield (placed.step.parent, 0), (placed.id, 0)


def _bridges(geometry: Geometry) -> Iterator[tuple[Bond, int]]:
    """What else holds pieces together, and the block that does; last in a bond."""
    for placed in geometry.blocks:
        if placed.two_ended:
            yield ((placed.step.parents[1], 0), (placed.id, 1)), placed.id
            if library()[placed.type].connector == "rod":
                yield ((placed.id, 0), (placed.id, 1)), placed.id
    for link in geometry.auto_connections:
        yield ((link.partner, 0), (link.block, 0)), link.block


def _warning(geometry: Geometry, block: int, holder: int, partner: int) -> Problem:
    def name(which: int) -> str:
        return block_label(which, geometry[which].type)

    if geometry[holder].two_ended:
        reason = f"{name(holder)} bridges it"
    else:
        reason = f"the front of {name(holder)} connects to {name(partner)} as well"
    text = f"the moving joint of {name(block)} cannot move: {reason}"
    return Problem("locked", tuple(sorted({block, holder})), text)


class _Groups:
    """Disjoint sets of pieces that are rigidly connected."""

    def __init__(self) -> None:
        self._up: dict[Piece, Piece] = {}

    def _find(self, piece: Piece) -> Piece:
        while (above := self._up.get(piece, piece)) != piece:
            piece = above
        return piece

    def join(self, bond: Bond) -> None:
        one, other = self._find(bond[0]), self._find(bond[1])
        self._up[max(one, other)] = min(one, other)

    def joined(self, bond: Bond) -> bool:
        return self._find(bond[0]) == self._find(bond[1])
