"""Find joints that cannot move because rigid connections bridge them, without simulating."""

from __future__ import annotations

from collections.abc import Iterator

from agentflow.machine.blocks.library import library
from agentflow.machine.geometry.placement import Geometry
from agentflow.machine.problems import Problem

Piece = tuple[int, int]
"""Block and end: 0 is the end at its parent, 1 the second end of a two-ended block."""
Bond = tuple[Piece, Piece]


def locked_joints(geometry: Geometry) -> list[Problem]:
    """One warning (`locked`) for each block of a file-valid machine whose joint cannot move."""
    groups = _Groups()
    joints: dict[int, Bond] = {}
    for placed in geometry.blocks[1:]:
        bond = (placed.step.parent, 0), (placed.id, 0)
        joint = library()[placed.type].joint
        if joint.moves:
            joints[placed.id] = bond
        elif joint.kind == "fixed":
            groups.join(bond)
    found = []
    for bridge, holder in _extra_bonds(geometry):
        groups.join(bridge)
        for block, bond in tuple(joints.items()):
            if groups.connected(bond):
                del joints[block]
                found.append(_warning(geometry, block, holder, bridge[0][0]))
    return sorted(found, key=lambda problem: problem.blocks)


def _extra_bonds(geometry: Geometry) -> Iterator[tuple[Bond, int]]:
    """Rigid connections other than to parents, each with the block that makes it (last)."""
    for placed in geometry.blocks:
        if placed.two_ended:
            yield ((placed.step.parents[1], 0), (placed.id, 1)), placed.id
            if library()[placed.type].connector == "rod":
                yield ((placed.id, 0), (placed.id, 1)), placed.id
    for link in geometry.auto_connections:
        yield ((link.partner, 0), (link.block, 0)), link.block


def _warning(geometry: Geometry, block: int, holder: int, partner: int) -> Problem:
    bridge = geometry[holder]
    if bridge.two_ended:
        reason = f"{bridge.label} bridges it"
    else:
        reason = f"the front of {bridge.label} also connects to {geometry[partner].label}"
    text = f"the moving joint of {geometry[block].label} cannot move: {reason}"
    return Problem("locked", tuple(sorted({block, holder})), text)


class _Groups:
    """Disjoint sets of rigidly connected pieces."""

    def __init__(self) -> None:
        self._up: dict[Piece, Piece] = {}

    def _find(self, piece: Piece) -> Piece:
        while (above := self._up.get(piece, piece)) != piece:
            piece = above
        return piece

    def join(self, bond: Bond) -> None:
        one, other = self._find(bond[0]), self._find(bond[1])
        self._up[max(one, other)] = min(one, other)

    def connected(self, bond: Bond) -> bool:
        return self._find(bond[0]) == self._find(bond[1])
