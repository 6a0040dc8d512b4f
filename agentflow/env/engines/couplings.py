"""Owns constraints between the links of PyBullet bodies: joints that close loops, meshing cogs.

Trees of joints are bodies.py's; a constraint carries what no tree can.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from agentflow.env.engines.base import Assembly, Joint
from agentflow.env.engines.bullet import pybullet
from agentflow.env.engines.frames import swap, swap_turn
from agentflow.env.engines.layout import Built, Handle
from agentflow.env.engines.tree import Skeleton
from agentflow.env.engines.vectors import add, cross, scale, subtract, turned
from agentflow.env.scene import Quat, Vec3

STRONGEST = 1e6
"""N or N m: more than anything that a machine can exert."""
HALF_AXLE = 0.5
"""Loops that turn are held at two points of their axis, this far from the pivot, m."""


class Couplings:
    """The constraints of one world."""

    def __init__(self, client: int) -> None:
        self._client = client
        self._ids: list[int] = []
        self._apart: list[tuple[Handle, Handle]] = []
        """Links that a loop joins, which do not collide, as no joint's links do."""
        self._loops: list[tuple[int, int, Vec3, list[int]]] = []
        """Joint, part that carries it, axis and constraints of each loop."""

    def renew(self, assembly: Assembly, plan: Skeleton, built: Sequence[Built]) -> None:
        """Make what the skeleton asks for, in place of what was."""
        self._clear()
        where = {part: (body.uid, index) for body in built for part, index in body.index.items()}
        for i in plan.loops:
            joint = assembly.joints[i]
            made = self._loop(assembly, joint, where)
            if joint.kind != "prismatic":
                self._loops.append((i, joint.a, swap_turn(joint.axis), made))
        carried = {link.joint: where[link.part] for body in plan.bodies for link in body.links}
        for mesh in assembly.actors.meshes:
            one, other = assembly.joints[mesh.a], assembly.joints[mesh.b]
            if (
                mesh.a in carried
                and mesh.b in carried
                and plan.cluster[one.a] == plan.cluster[other.a]
            ):
                self._mesh(carried[mesh.a], carried[mesh.b], mesh.ratio)

    def _clear(self) -> None:
        """PyBullet has removed by itself those of bodies that are gone."""
        count = pybullet.getNumConstraints(self._client)
        there = {pybullet.getConstraintUniqueId(i, self._client) for i in range(count)}
        for constraint in self._ids:
            if constraint in there:
                pybullet.removeConstraint(constraint, self._client)
        self._ids = []
        for one, other in self._apart:
            self._collide(one, other, True)
        self._apart = []
        self._loops = []

    def loads(self, rotation: Callable[[int], Quat]) -> list[tuple[int, list[float]]]:
        """Joint and load (6,) of each loop in the last step, along the engine's axes; loops that
        slide are not measured.

        Args:
            rotation: Of a part, in the engine's frame.
        """
        found = []
        for joint, part, axis, made in self._loops:
            states = [pybullet.getConstraintState(i, self._client) for i in made]
            force, torque = states[0], (0.0, 0.0, 0.0)
            if len(states) == 2:
                arm = scale(turned(rotation(part), axis), HALF_AXLE)
                force, torque = add(*states), cross(arm, subtract(*states))
            found.append((joint, [*force, *torque]))
        return found

    def _collide(self, one: Handle, other: Handle, on: bool) -> None:
        (uid, link), (other_uid, other_link) = one, other
        pybullet.setCollisionFilterPair(uid, other_uid, link, other_link, on, self._client)

    def _loop(self, assembly: Assembly, joint: Joint, where: dict[int, Handle]) -> list[int]:
        """Hold the two parts of a joint together as the joint would; the constraints."""
        points: tuple[Vec3, ...] = (joint.pivot,)
        kind = pybullet.JOINT_POINT2POINT
        if joint.kind == "revolute":
            half = scale(joint.axis, HALF_AXLE)
            points = (add(joint.pivot, half), subtract(joint.pivot, half))
        elif joint.kind == "prismatic":
            kind = pybullet.JOINT_PRISMATIC
        self._apart.append((where[joint.a], where[joint.b]))
        self._collide(where[joint.a], where[joint.b], False)
        return [
            self._bind(
                kind,
                where[joint.a],
                where[joint.b],
                swap(joint.axis),
                swap(subtract(point, assembly.parts[joint.a].centre)),
                swap(subtract(point, assembly.parts[joint.b].centre)),
            )
            for point in points
        ]

    def _mesh(self, one: Handle, other: Handle, ratio: float) -> None:
        """Couple the turns of two cogs on one carrier."""
        nowhere = (0.0, 0.0, 0.0)
        made = self._bind(pybullet.JOINT_GEAR, one, other, (0.0, 0.0, 1.0), nowhere, nowhere)
        pybullet.changeConstraint(made, gearRatio=ratio, physicsClientId=self._client)

    def _bind(
        self, kind: int, one: Handle, other: Handle, axis: Vec3, at_one: Vec3, at_other: Vec3
    ) -> int:
        made = int(
            pybullet.createConstraint(
                *one, *other, kind, axis, at_one, at_other, physicsClientId=self._client
            )
        )
        pybullet.changeConstraint(made, maxForce=STRONGEST, physicsClientId=self._client)
        self._ids.append(made)
        return made
