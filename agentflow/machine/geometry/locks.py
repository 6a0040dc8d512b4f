"""Find joints that cannot move because other connections hold their parts, without simulating."""

from __future__ import annotations

from agentflow.machine.geometry.mobility import JAMMED, lock
from agentflow.machine.geometry.pieces import Bond, extra_bonds, parent_bonds
from agentflow.machine.geometry.placement import Geometry
from agentflow.machine.geometry.sets import Sets
from agentflow.machine.problems import Problem


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
        sets.join(bridge.a, bridge.b)
        for joint in _within(sets, joints):
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
