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
    inverse,
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
        """Links joined by a joint that is not in the tree; like those of any joint, they do not
        collide."""
        self._loops: list[tuple[int, Joint, list[int]]] = []
        """Joint index, joint and constraints of each loop."""

    def renew(self, assembly: Assembly, plan: Skeleton, handles: Mapping[int, Handle]) -> None:
        """Replace all constraints by those that the skeleton needs."""
        remove_constraints(self._client, self._ids)
        for pair in self._apart:
            set_collision(self._client, *pair, True)
        self._ids, self._apart, self._loops = [], [], []
        for loop in plan.loops:
            joint = assembly.joints[loop.joint]
            self._loops.append((loop.joint, joint, self._loop(assembly, joint, handles)))
        for joint in (assembly.joints[parallel.joint] for parallel in plan.parallel):
            self._part(handles[joint.a], handles[joint.b])
        carried = {link.joint: (handles[link.part], 1.0) for link in plan.links}
        carried |= {
            parallel.joint: (handles[link.part], parallel.sign)
            for link in plan.links
            for parallel in link.parallel
        }
        for mesh in assembly.devices.cog_meshes:
            one, other = assembly.joints[mesh.a], assembly.joints[mesh.b]
            if (
                mesh.a in carried
                and mesh.b in carried
                and plan.cluster[one.a] == plan.cluster[other.a]
            ):
                (at, sign), (at_other, sign_other) = carried[mesh.a], carried[mesh.b]
                self._couple_cogs(at, at_other, sign * sign_other * mesh.ratio)

    def loads(self, rotation: Callable[[int], Quat]) -> list[tuple[int, list[float]]]:
        """Joint and load (6,) of each loop in the last step, in the axes of its part `b`; without
        what its drive exerts.

        Args:
            rotation: Of a part, in the engine's frame.
        """
        found = []
        for i, joint, made in self._loops:
            states = [pybullet.getConstraintState(each, self._client) for each in made]
            turn, back = rotation(joint.a), inverse(rotation(joint.b))
            if joint.kind == "prismatic":
                load = _slider_load(states[0], swap(joint.axis), turn)
            elif joint.kind == "revolute":
                arm = scale(rotate_vector(turn, swap_turn(joint.axis)), HALF_AXLE)
                load = [*add(*states), *cross(arm, subtract(*states))]
            else:
                load = [*states[0], 0.0, 0.0, 0.0]
            fx, fy, fz, tx, ty, tz = load
            force, torque = rotate_vector(back, (fx, fy, fz)), rotate_vector(back, (tx, ty, tz))
            found.append((i, [*swap(force), *swap_turn(torque)]))
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
        self._part(one, other)
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

    def _part(self, one: Handle, other: Handle) -> None:
        """Let two links that a joint connects pass through each other."""
        self._apart.append((one, other))
        set_collision(self._client, one, other, False)

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
