"""PyBullet constraints: what closes loops, and meshing cogs."""

from collections.abc import Iterable

from agentflow.env.physics.pybullet.bodies import MIDDLE, Built, Handle
from agentflow.env.physics.pybullet.library import pybullet
from agentflow.env.physics.structure.drives import meshing_cogs

STRONGEST = 1e6
"""N or N m: more than anything that a machine can exert."""


class Couplings:
    """The constraints of one world."""

    def __init__(self, client: int) -> None:
        self._client = client
        self._ids: list[int] = []
        self._apart: list[tuple[Handle, Handle]] = []
        """Links joined by a joint that is not in the tree; like those of any joint, they do not
        collide."""

    def renew(self, built: Built) -> None:
        """Replace all constraints by those that the skeleton needs."""
        plan, handles, joints = built.plan, built.handles, built.assembly.joints
        remove_constraints(self._client, self._ids)
        for pair in self._apart:
            set_collision(self._client, *pair, True)
        self._ids = []
        closing = [joints[loop.joint] for loop in plan.loops]
        closing += [joints[other.joint] for other in plan.parallel]
        self._apart = [(handles[joint.a], handles[joint.b]) for joint in closing]
        for pair in self._apart:
            set_collision(self._client, *pair, False)
        movers = {link.joint: (body.uid, i) for body in built.pieces for link, i in body.joints}
        for loop in plan.loops:
            self._bind(pybullet.JOINT_FIXED, movers[loop.joint], handles[loop.part], MIDDLE)
        links = (*plan.links, *plan.loops)
        for mesh, (one, sign), (other, sign_other) in meshing_cogs(built.assembly, plan, links):
            made = self._bind(pybullet.JOINT_GEAR, movers[one], movers[other], (0.0, 0.0, 1.0))
            ratio = sign * sign_other * mesh.ratio
            pybullet.changeConstraint(made, gearRatio=ratio, physicsClientId=self._client)

    def _bind(self, kind: int, one: Handle, other: Handle, axis: tuple[float, float, float]) -> int:
        """Constrain two links at their centres of mass."""
        made: int = pybullet.createConstraint(
            *one, *other, kind, axis, MIDDLE, MIDDLE, physicsClientId=self._client
        )
        pybullet.changeConstraint(made, maxForce=STRONGEST, physicsClientId=self._client)
        self._ids.append(made)
        return made


def remove_constraints(client: int, ids: Iterable[int]) -> None:
    """Remove constraints, but for those that PyBullet removed together with a body."""
    count = pybullet.getNumConstraints(client)
    present = {pybullet.getConstraintUniqueId(i, client) for i in range(count)}
    for constraint in ids:
        if constraint in present:
            pybullet.removeConstraint(constraint, client)


def set_collision(client: int, one: Handle, other: Handle, on: bool) -> None:
    """Let two links collide or pass through each other."""
    (uid, link), (other_uid, other_link) = one, other
    pybullet.setCollisionFilterPair(uid, other_uid, link, other_link, on, client)
