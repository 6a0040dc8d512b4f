"""PyBullet constraints: joints that close loops, and meshing cogs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence

from agentflow.env.physics.frames import swap, swap_turn
from agentflow.env.physics.model import Assembly, Joint
from agentflow.env.physics.pybullet.bodies import Handle
from agentflow.env.physics.pybullet.library import pybullet
from agentflow.env.physics.spanning_tree import Skeleton
from agentflow.machine.geometry.vectors import (
    Quat,
    Vec3,
    add,
    cross,
    length,
    rotate_vector,
    scale,
    subtract,
)

STRONGEST = 1e6
"""N or N m: more than anything that a machine can exert."""
HALF_AXLE = 0.5
"""Revolute loops are held at two points of their axis, this far from the pivot, m."""
ALONG = 1e-6
"""Sine of the angle below which PyBullet takes an axis to lie along x."""


class Couplings:
    """The constraints of one world."""

    def __init__(self, client: int) -> None:
        self._client = client
        self._ids: list[int] = []
        self._apart: list[tuple[Handle, Handle]] = []
        """Links joined by a loop; like the links of any joint, they do not collide."""
        self._loops: list[tuple[int, Joint, list[int]]] = []
        """Joint index, joint and constraints of each loop."""

    def renew(self, assembly: Assembly, plan: Skeleton, handles: Mapping[int, Handle]) -> None:
        """Replace all constraints by those that the skeleton needs."""
        remove_constraints(self._client, self._ids)
        for pair in self._apart:
            set_collision(self._client, *pair, True)
        self._ids, self._apart, self._loops = [], [], []
        for i in plan.loops:
            joint = assembly.joints[i]
            self._loops.append((i, joint, self._loop(assembly, joint, handles)))
        carried = {link.joint: handles[link.part] for link in plan.links}
        for mesh in assembly.devices.cog_meshes:
            one, other = assembly.joints[mesh.a], assembly.joints[mesh.b]
            if (
                mesh.a in carried
                and mesh.b in carried
                and plan.cluster[one.a] == plan.cluster[other.a]
            ):
                self._couple_cogs(carried[mesh.a], carried[mesh.b], mesh.ratio)

    def loads(self, rotation: Callable[[int], Quat]) -> list[tuple[int, list[float]]]:
        """Joint and load (6,) of each loop in the last step, game frame; without the spring force
        of sliding joints.

        Args:
            rotation: Of a part, in the engine's frame.
        """
        found = []
        for i, joint, made in self._loops:
            states = [pybullet.getConstraintState(each, self._client) for each in made]
            turn = rotation(joint.a)
            if joint.kind == "prismatic":
                load = _slider_load(states[0], swap(joint.axis), turn)
            elif joint.kind == "revolute":
                arm = scale(rotate_vector(turn, swap_turn(joint.axis)), HALF_AXLE)
                load = [*add(*states), *cross(arm, subtract(*states))]
            else:
                load = [*states[0], 0.0, 0.0, 0.0]
            found.append((i, [*swap(load[:3]), *swap_turn(load[3:])]))
        return found

    def _loop(self, assembly: Assembly, joint: Joint, handles: Mapping[int, Handle]) -> list[int]:
        """Constrain two parts as their joint would; returns the numbers of the constraints."""
        one, other = handles[joint.a], handles[joint.b]
        points: tuple[Vec3, ...] = (joint.pivot,)
        kind = pybullet.JOINT_POINT2POINT
        if joint.kind == "revolute":
            half = scale(joint.axis, HALF_AXLE)
            points = (add(joint.pivot, half), subtract(joint.pivot, half))
        elif joint.kind == "prismatic":
            kind = pybullet.JOINT_PRISMATIC
        self._apart.append((one, other))
        set_collision(self._client, one, other, False)
        return [
            self._bind(
                kind,
                one,
                other,
                swap(joint.axis),
                swap(subtract(point, assembly.parts[joint.a].centre)),
                swap(subtract(point, assembly.parts[joint.b].centre)),
            )
            for point in points
        ]

    def _couple_cogs(self, one: Handle, other: Handle, ratio: float) -> None:
        """Couple the rotation of two cogs on one carrier."""
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


def _slider_load(state: Sequence[float], axis: Vec3, turn: Quat) -> list[float]:
    """Load of a sliding loop.

    Args:
        state: From PyBullet: forces along two directions across the axis, then torques that the
            other part exerts about z, x and y, all in the axes of the part that carries it.
        axis: Unit vector at rest, engine frame.
        turn: Orientation of that part.
    """
    side = cross(axis, (1.0, 0.0, 0.0))
    if length(side) < ALONG:
        side = cross(axis, (0.0, 1.0, 0.0))
    side = scale(side, 1.0 / length(side))
    first, second, about_z, about_x, about_y = state
    force = add(scale(side, first), scale(cross(axis, side), second))
    return [*rotate_vector(turn, force), *rotate_vector(turn, (-about_x, -about_y, -about_z))]
