"""PyBullet bodies from the ground, objects and pieces of a machine.

Every link frame is at its joint and aligned with the machine frame at rest.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from math import sqrt

from agentflow.env.constants import Constants
from agentflow.env.physics.engine import TooLargeError
from agentflow.env.physics.frames import swap, swap_quaternion
from agentflow.env.physics.model import Assembly, Joint, Part, Shape
from agentflow.env.physics.pybullet import PYBULLET
from agentflow.env.physics.pybullet.library import pybullet
from agentflow.env.physics.solids import YIELD, cone_corners, joint_axis, solid_shapes
from agentflow.env.physics.structure.drives import merge_drives
from agentflow.env.physics.structure.layout import RowLayout
from agentflow.env.physics.structure.spanning_tree import Link, Piece, Skeleton
from agentflow.env.scene import SceneObject
from agentflow.machine.geometry.vectors import IDENTITY, Vec3, add, rotate_vector, scale, subtract

FASTEST = 1e6
"""Speed limit of a body, m/s and rad/s. PyBullet's default of 100 would keep machines that explode
from diverging. Set on a link instead of the base, the same setting changes contacts."""
MIDDLE: Vec3 = (0.0, 0.0, 0.0)

Handle = tuple[int, int]
"""Body and link number; link -1 is the base."""

_KINDS = {
    "fixed": pybullet.JOINT_FIXED,
    "revolute": pybullet.JOINT_REVOLUTE,
    "prismatic": pybullet.JOINT_PRISMATIC,
    "spherical": pybullet.JOINT_SPHERICAL,
}


@dataclass(frozen=True)
class PieceBody:
    """A piece of the machine as a body, with its number and the link number of each part."""

    uid: int
    piece: Piece
    index: Mapping[int, int]
    joints: tuple[tuple[Link, int], ...]
    """The links of the piece, then its loops, with their link numbers.

    A loop is a joint like the others, from its part `a` to a twin of its part `b`, which has no
    shape and a share of that part's mass, and is held to it by a constraint."""


@dataclass(frozen=True)
class Built:
    """Everything that exists in a client until the next split: the pieces of a machine as bodies,
    and the body number of each object of the scene."""

    client: int
    assembly: Assembly
    plan: Skeleton
    layout: RowLayout
    pieces: tuple[PieceBody, ...]
    objects: Mapping[str, int]

    @cached_property
    def handles(self) -> Mapping[int, Handle]:
        """The handle of each part."""
        return {part: (body.uid, i) for body in self.pieces for part, i in body.index.items()}


class BodyBuilder:
    """Makes shapes and bodies in one client; equal shapes are shared."""

    def __init__(self, client: int, physics: Constants) -> None:
        self.client = client
        self._add_body = partial(pybullet.createMultiBody, physicsClientId=client)
        self._change = partial(pybullet.changeDynamics, physicsClientId=client)
        self._usual = physics["friction"], physics["restitution"]
        self._made: dict[tuple[tuple[Shape, ...], Vec3], int] = {}

    def ground(self, friction: float | None) -> int:
        """The plane y = 0; friction None is that of the constants."""
        plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=self.client)
        uid: int = self._add_body(0.0, plane, -1, MIDDLE, IDENTITY)
        self._surface(uid, -1, friction, None)
        return uid

    def item(self, item: SceneObject) -> int:
        """An object of the scene, fixed or moving."""
        if item.shape == "cone":
            solid = self._cone(item)
        else:
            solid = self._shapes((Shape(item.shape, item.size),), subtract(MIDDLE, item.balance))
        place = add(item.position, rotate_vector(item.rotation, item.balance))
        turn = swap_quaternion(item.rotation)
        uid: int = self._add_body(item.mass, solid, -1, swap(place), turn)
        self._surface(uid, -1, item.friction, item.restitution)
        if item.stiffness is not None:
            stiff, damping = item.stiffness, YIELD * item.stiffness
            self._change(uid, -1, contactStiffness=stiff, contactDamping=damping)
        return uid

    def machine(self, piece: Piece, parts: Sequence[Part], joints: Sequence[Joint]) -> PieceBody:
        """One piece of the machine, at rest in its place.

        Raises:
            TooLargeError: It has more links than PyBullet can hold.
        """
        links = (*piece.links, *piece.loops)
        most = PYBULLET.most_parts
        if most is not None and len(links) >= most:
            raise TooLargeError(len(links) + 1, most, PYBULLET.name)
        frames = {piece.root: parts[piece.root].centre}
        frames |= {link.part: joints[link.joint].pivot for link in piece.links}
        order = {piece.root: 0} | {link.part: i for i, link in enumerate(piece.links, 1)}
        solids = {
            part: self._shapes(each, subtract(parts[part].centre, frames[part]))
            for part, each in solid_shapes(piece, parts).items()
        }
        twins = Counter(loop.part for loop in piece.loops)
        masses = {part: parts[part].mass / (1 + twins[part]) for part in order}
        pivots = [joints[link.joint].pivot for link in links]
        root = parts[piece.root]
        uid: int = self._add_body(
            masses[piece.root],
            solids[piece.root],
            -1,
            swap(root.centre),
            linkMasses=[masses[link.part] for link in links],
            linkCollisionShapeIndices=[
                *(solids[link.part] for link in piece.links),
                *(-1 for _ in piece.loops),
            ],
            linkVisualShapeIndices=[-1] * len(links),
            linkPositions=[
                swap(subtract(pivot, frames[link.parent]))
                for link, pivot in zip(links, pivots, strict=True)
            ],
            linkOrientations=[IDENTITY] * len(links),
            linkInertialFramePositions=[
                swap(subtract(parts[link.part].centre, pivot))
                for link, pivot in zip(links, pivots, strict=True)
            ],
            linkInertialFrameOrientations=[IDENTITY] * len(links),
            linkParentIndices=[order[link.parent] for link in links],
            linkJointTypes=[
                _KINDS["fixed" if link.rigid else joints[link.joint].kind] for link in links
            ],
            linkJointAxis=[joint_axis(joints[link.joint], link) for link in links],
            flags=pybullet.URDF_USE_SELF_COLLISION
            | pybullet.URDF_USE_SELF_COLLISION_EXCLUDE_PARENT,
        )
        self._change(uid, -1, maxJointVelocity=FASTEST)
        numbered = tuple(zip(links, self._numbers(uid, len(links)), strict=True))
        index = {piece.root: -1} | {link.part: i for link, i in numbered[: len(piece.links)]}
        for part in order:
            self._dynamics(uid, index[part], parts[part], 1 + twins[part])
        for loop, i in numbered[len(piece.links) :]:
            self._dynamics(uid, i, parts[loop.part], 1 + twins[loop.part])
        for link, i in numbered:
            self._joint(uid, i, link, joints)
        return PieceBody(uid, piece, index, numbered)

    def _numbers(self, uid: int, count: int) -> list[int]:
        """PyBullet renumbers links depth first but keeps their names: joint1, joint2, ..."""
        names = {
            pybullet.getJointInfo(uid, i, physicsClientId=self.client)[1]: i for i in range(count)
        }
        return [names[b"joint%d" % i] for i in range(1, count + 1)]

    def _dynamics(self, uid: int, index: int, part: Part, twins: int) -> None:
        """Set the surface of a link, and the inertia of one of so many twins of a part."""
        self._change(uid, index, localInertiaDiagonal=scale(swap(part.inertia), 1.0 / twins))
        self._surface(uid, index, part.friction, part.restitution, part.rolling_friction)

    def _surface(
        self,
        uid: int,
        index: int,
        friction: float | None,
        restitution: float | None,
        rolling: float = 0.0,
    ) -> None:
        """Set the surface of a link; None stands for the constants' values.

        Bullet multiplies the coefficients of two surfaces, so their square roots give the
        geometric mean.
        """
        usual_friction, usual_restitution = self._usual
        self._change(
            uid,
            index,
            lateralFriction=sqrt(usual_friction if friction is None else friction),
            restitution=sqrt(usual_restitution if restitution is None else restitution),
            rollingFriction=rolling,
            spinningFriction=0.0,
            linearDamping=0.0,
            angularDamping=0.0,
            jointDamping=0.0,
        )

    def _joint(self, uid: int, index: int, link: Link, joints: Sequence[Joint]) -> None:
        """Set sensors and stops."""
        pybullet.enableJointForceTorqueSensor(uid, index, True, physicsClientId=self.client)
        stops = merge_drives(joints, link).stops
        if stops is not None and not link.rigid:
            self._change(uid, index, jointLowerLimit=stops[0], jointUpperLimit=stops[1])

    def _shapes(self, solid: tuple[Shape, ...], offset: Vec3) -> int:
        """Number of the collision shape of solid shapes; -1 if there are none."""
        if not solid:
            return -1
        key = (solid, offset)
        if key not in self._made:
            kinds, halves, radii, lengths = zip(*map(_geometry, solid), strict=True)
            self._made[key] = pybullet.createCollisionShapeArray(
                shapeTypes=kinds,
                halfExtents=halves,
                radii=radii,
                lengths=lengths,
                collisionFramePositions=[swap(add(offset, shape.offset)) for shape in solid],
                collisionFrameOrientations=[swap_quaternion(shape.rotation) for shape in solid],
                physicsClientId=self.client,
            )
        return self._made[key]

    def _cone(self, item: SceneObject) -> int:
        corners = [swap(subtract(corner, item.balance)) for corner in cone_corners(item.size)]
        made: int = pybullet.createCollisionShape(
            pybullet.GEOM_MESH, vertices=corners, physicsClientId=self.client
        )
        return made


def _geometry(shape: Shape) -> tuple[int, Vec3, float, float]:
    """PyBullet's type, half extents, radius and length; its cylinders lie along z, our y."""
    half = scale(swap(shape.size), 0.5)
    if shape.kind == "sphere":
        return pybullet.GEOM_SPHERE, half, half[0], 0.0
    if shape.kind == "cylinder":
        return pybullet.GEOM_CYLINDER, half, half[0], shape.size[1]
    return pybullet.GEOM_BOX, half, 0.0, 0.0
