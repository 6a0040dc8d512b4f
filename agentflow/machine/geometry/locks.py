"""Find joints that cannot move because rigid connections bridge them, without simulating."""

from __future__ import annotations

from agentflow.machine.blocks.library import library
from agentflow.machine.geometry.pieces import Bond, Groups, extra_bonds
from agentflow.machine.geometry.placement import Geometry
from agentflow.machine.problems import Problem


def locked_joints(geometry: Geometry) -> list[Problem]:
    """One warning (`locked`) for each block of a file-valid machine whose joint cannot move."""
    groups = Groups()
    joints: dict[int, Bond] = {}
    for placed in geometry.blocks[1:]:
        bond = (placed.step.parent, 0), (placed.id, 0)
        joint = library()[placed.type].joint
        if joint.moves:
            joints[placed.id] = bond
        elif joint.kind == "fixed":
            groups.join(bond)
    found = []
    for bridge, holder in extra_bonds(geometry):
        groups.join(bridge)
        for block, bond in tuple(joints.items()):
            if groups.connected(bond):
                del joints[block]
                found.append(_warning(geometry, block, holder, bridge[0][0]))
    return sorted(found, key=lambda problem: problem.blocks)


def _warning(geometry: Geometry, block: int, holder: int, partner: int) -> Problem:
    bridge = geometry[holder]
    if bridge.two_ended:
        reason = f"{bridge.label} bridges it"
    else:
        reason = f"the front of {bridge.label} also connects to {geometry[partner].label}"
    text = f"the moving joint of {geometry[block].label} cannot move: {reason}"
    return Problem("locked", tuple(sorted({block, holder})), text)
