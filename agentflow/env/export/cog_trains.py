"""Trains of meshing cogs, each led by one of them."""

from __future__ import annotations

from collections.abc import Mapping

from agentflow.env.physics.model import Assembly
from agentflow.env.physics.structure.spanning_tree import Skeleton


def train_leaders(assembly: Assembly, plan: Skeleton) -> Mapping[int, tuple[int, float]]:
    """Joint of each cog that meshes -> the joint that leads its train, one with a motor if there
    is any, and its position over that joint's."""
    lead = {link.joint: (link.joint, 1.0) for link in plan.links if not link.rigid}
    for link in plan.links:
        lead |= {other.joint: (link.joint, other.sign) for other in link.parallel}
    near: dict[int, list[tuple[int, float]]] = {}
    for mesh in assembly.devices.cog_meshes:
        carriers = {plan.cluster[assembly.joints[i].a] for i in (mesh.a, mesh.b)}
        if mesh.a in lead and mesh.b in lead and len(carriers) == 1:
            (one, sign), (other, sign_other) = lead[mesh.a], lead[mesh.b]
            ratio = -mesh.ratio * sign * sign_other
            near.setdefault(other, []).append((one, ratio))
            near.setdefault(one, []).append((other, 1.0 / ratio))
    found: dict[int, tuple[int, float]] = {}
    for first in sorted(near, key=lambda i: not assembly.joints[i].drive.torque):
        train = [] if first in found else [first]
        found.setdefault(first, (first, 1.0))
        for i in train:
            for other, ratio in near[i]:
                if other not in found:
                    found[other] = first, ratio * found[i][1]
                    train.append(other)
    return found
