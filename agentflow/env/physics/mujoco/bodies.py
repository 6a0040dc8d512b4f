"""A MuJoCo model of one world: ground, objects and pieces of a machine.

Each part is a body of its own, whose frame is at its joint and aligned with the machine frame at
rest. A rigid joint is a body without joint in its parent; the root of a piece has a free joint.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import mujoco

from agentflow.env.constants import Constants
from agentflow.env.physics.frames import swap, swap_quaternion
from agentflow.env.physics.model import Assembly, Joint, Shape
from agentflow.env.physics.mujoco.couplings import FIRM, add_grip, hard, mesh_cogs, weld
from agentflow.env.physics.mujoco.shapes import ShapeWriter, wxyz
from agentflow.env.physics.mujoco.surfaces import FIXED, Surface, Surfaces
from agentflow.env.physics.solids import joint_axis, solid_shapes
from agentflow.env.physics.structure.drives import merge_drives
from agentflow.env.physics.structure.layout import RowLayout
from agentflow.env.physics.structure.spanning_tree import Link, Piece, Skeleton
from agentflow.env.scene import Body, Scene, SceneObject
from agentflow.machine.geometry.vectors import IDENTITY, Vec3, add, rotate_vector, scale, subtract

TOUCH = 0.005
"""What is at most this far from a grabber is gripped, m."""
TANGENTIAL = 100.0
"""Stiffness of friction over that of the normal force. With 1, what rests on a slope creeps; with
10, rolling friction hardly brakes a boulder that is slow."""
HARD = (0.95, 0.99, 0.001, 0.5, 2.0)
"""Impedance of stops."""
OFF = (
    mujoco.mjtDisableBit.mjDSBL_AUTORESET  # would hide that a simulation diverged
    | mujoco.mjtDisableBit.mjDSBL_FILTERPARENT  # would let whole clusters pass through each other
    | mujoco.mjtDisableBit.mjDSBL_MULTICCD
)
_ROW = (
    mujoco.mjtSensor.mjSENS_FRAMEPOS,
    mujoco.mjtSensor.mjSENS_FRAMEQUAT,
    mujoco.mjtSensor.mjSENS_FRAMELINVEL,
    mujoco.mjtSensor.mjSENS_FRAMEANGVEL,
)
_BORNE = mujoco.mjtSensor.mjSENS_FORCE, mujoco.mjtSensor.mjSENS_TORQUE
CHANGED = (
    *("body_mass", "body_subtreemass", "body_inertia", "body_invweight0", "dof_invweight0"),
    *("dof_frictionloss", "eq_obj2id", "eq_data"),
)
"""Arrays of a model that something writes to besides `set_step_length`: loads, motors that differ,
grabbers, cogs."""
_KINDS = {
    "revolute": mujoco.mjtJoint.mjJNT_HINGE,
    "prismatic": mujoco.mjtJoint.mjJNT_SLIDE,
    "spherical": mujoco.mjtJoint.mjJNT_BALL,
}


@dataclass(frozen=True)
class JointAddress:
    """Where MuJoCo stores the motion of a joint."""

    position: int
    """First index in `qpos`."""
    velocity: int
    """First index in `qvel`."""


@dataclass(frozen=True)
class CompiledModel:
    """A compiled model, its state, and where everything is in them."""

    spec: Any
    """What the model was compiled from."""
    model: Any
    data: Any
    parts: tuple[int, ...]
    """Body number of each part."""
    objects: Mapping[str, int]
    """Body number of each moving object."""
    roots: Mapping[int, JointAddress]
    """Free joint of the root part of each piece."""
    loose: Mapping[str, JointAddress]
    """Free joint of each moving object."""
    links: tuple[Link, ...]
    """Those of the trees, then the loops; in the order of their sensors."""
    joints: Mapping[int, JointAddress]
    """Address of each joint that moves."""
    owners: tuple[Body, ...]
    """Block or object that each shape belongs to."""
    lively: tuple[bool, ...]
    """Whether each shape rebounds more than usual."""
    grips: Mapping[int, int]
    """Constraint of each part that is a grabber."""
    fresh: Mapping[str, Any]
    """Of the model's arrays, those that a rollout changes (`CHANGED`), as they were compiled."""


def build(
    physics: Constants,
    assembly: Assembly,
    plan: Skeleton,
    layout: RowLayout,
    scene: Scene,
    step: float,
) -> CompiledModel:
    """Compile the model of a world, with the machine at rest where it was assembled."""
    return _Builder(physics, assembly, plan, scene, step).finish(layout)


def begin_again(built: CompiledModel, step: float) -> None:
    """Bring a model back to the state in which it was compiled, for steps of this length, s."""
    for name, values in built.fresh.items():
        getattr(built.model, name)[:] = values
    mujoco.mj_resetData(built.model, built.data)
    set_step_length(built.model, step)


def set_step_length(model: Any, step: float) -> None:
    """Take steps of this length, s, from the next `mj_step1` on.

    Time constants follow: MuJoCo replaces those of less than two steps by a softer one.
    """
    model.opt.timestep = step
    model.jnt_solref[:] = _fast(step)
    model.eq_solref[:] = hard(step)
    model.dof_solref[:] = _braking(step)


def weigh_objects(built: CompiledModel, scene: Scene) -> None:
    """Give the moving objects the masses that they have in this scene."""
    model = built.model
    for item in scene.moving:
        body, address = built.objects[item.name], built.loose[item.name]
        share = item.mass / model.body_mass[body]
        model.body_mass[body] = model.body_subtreemass[body] = item.mass
        model.body_inertia[body] = inertia_of(item)
        model.body_invweight0[body] /= share
        model.dof_invweight0[address.velocity : address.velocity + 6] /= share


def _fast(step: float) -> tuple[float, float]:
    """The shortest time constant that MuJoCo takes, critically damped."""
    return 2.0 * step, 1.0


def _braking(step: float) -> tuple[float, float]:
    """No stiffness, and damping that stops a motion in one step."""
    return 0.0, -1.0 / step


class _Builder:
    """Fills one MuJoCo specification. It sets most attributes one by one: MuJoCo takes longer to
    read arguments."""

    def __init__(
        self, physics: Constants, assembly: Assembly, plan: Skeleton, scene: Scene, step: float
    ) -> None:
        self._assembly, self._plan, self._step = assembly, plan, step
        self._spec = spec = mujoco.MjSpec()
        spec.compiler.autolimits = spec.compiler.degree = False
        option = spec.option
        option.gravity = [0.0, 0.0, -physics["gravity"]]
        option.timestep = step
        option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
        option.impratio = TANGENTIAL
        option.disableflags = int(OFF)
        spec.default.geom.mass = 0.0
        self._surfaces = Surfaces(physics, spec.default.geom)
        self._shapes = ShapeWriter(spec, self._surfaces)
        self._apart: set[tuple[str, str]] = set()
        self._objects: dict[str, tuple[Any, Any]] = {}
        self._parts: dict[int, Any] = {}
        self._roots: dict[int, Any] = {}
        self._joints: dict[int, Any] = {}
        self._grabbers = {grip.part for grip in assembly.devices.grippers}
        self._shares = Counter(loop.part for loop in plan.loops)
        """How many loops end at each part; each has a share of the part's mass."""
        self._shapes.add_ground(self._surfaces.item(scene.friction, None), FIXED)
        for number, item in enumerate(scene.objects):
            self._item(item, FIXED - 1 - number)
        for piece in plan.pieces:
            self._piece(piece)

    def finish(self, layout: RowLayout) -> CompiledModel:
        """Add what refers to several bodies, and compile."""
        spec, joints = self._spec, self._assembly.joints
        for parallel in self._plan.parallel:
            joint = joints[parallel.joint]
            self._apart.add((_name(joint.a), _name(joint.b)))
        for one, other in sorted(self._apart):
            spec.add_exclude(bodyname1=one, bodyname2=other)
        self._surfaces.pair(spec, self._apart)
        mesh_cogs(spec, self._assembly, self._plan, self._joints, self._step)
        for grip in self._assembly.devices.grippers:
            add_grip(spec, _name(grip.part), self._step)
        links = (*self._plan.links, *self._plan.loops)
        for link in links:
            self._sense(_BORNE, mujoco.mjtObj.mjOBJ_SITE, str(link.joint))
        for name in (*map(_name, layout.leading), *map(_name, layout.objects)):
            self._sense(_ROW, mujoco.mjtObj.mjOBJ_BODY, name)
        model = spec.compile()

        shapes = self._shapes.shapes
        order = sorted(range(model.ngeom), key=lambda i: shapes[i][0].id)

        def address(joint: Any) -> JointAddress:
            return JointAddress(int(model.jnt_qposadr[joint.id]), int(model.jnt_dofadr[joint.id]))

        return CompiledModel(
            spec,
            model,
            mujoco.MjData(model),
            parts=tuple(self._parts[part].id for part in range(len(self._assembly.parts))),
            objects={name: body.id for name, (body, _) in self._objects.items()},
            roots={part: address(joint) for part, joint in self._roots.items()},
            loose={name: address(joint) for name, (_, joint) in self._objects.items()},
            links=links,
            joints={joint: address(made) for joint, made in self._joints.items()},
            owners=tuple(shapes[i][1] for i in order),
            lively=tuple(self._surfaces.lively[i] for i in order),
            grips={
                grip.part: model.equality(_name(grip.part)).id
                for grip in self._assembly.devices.grippers
            },
            fresh={name: getattr(model, name).copy() for name in CHANGED},
        )

    def _sense(self, kinds: Sequence[Any], of: Any, name: str) -> None:
        """Sensors of a body or site."""
        for kind in kinds:
            sensor = self._spec.add_sensor()
            sensor.type, sensor.objtype, sensor.objname = kind, of, name

    def _item(self, item: SceneObject, cluster: int) -> None:
        body, at, rotation = self._spec.worldbody, item.position, item.rotation
        if item.mass > 0:
            middle = swap(add(at, rotate_vector(rotation, item.balance)))
            turn = wxyz(swap_quaternion(rotation))
            body = body.add_body(name=_name(item.name), pos=middle, quat=turn)
            _weigh(body, item.mass, inertia_of(item))
            self._objects[item.name] = body, body.add_freejoint()
            at, rotation = scale(item.balance, -1.0), IDENTITY
        else:
            cluster = FIXED
        surface = self._surfaces.item(item.friction, item.restitution)
        kind, size = item.shape, item.size
        self._shapes.add(body, item.name, kind, size, at, rotation, surface, cluster)

    def _piece(self, piece: Piece) -> None:
        parts, joints = self._assembly.parts, self._assembly.joints
        shapes = solid_shapes(piece, parts)
        root = parts[piece.root].centre
        frames = {piece.root: root}
        body = self._spec.worldbody.add_body(name=_name(piece.root), pos=swap(root))
        self._roots[piece.root] = body.add_freejoint()
        self._part(body, piece.root, root, shapes[piece.root])
        for link in piece.links:
            pivot = frames[link.part] = joints[link.joint].pivot
            body = self._hang(link, frames, _name(link.part))
            self._part(body, link.part, pivot, shapes[link.part])
        for loop in piece.loops:
            self._close(loop, frames)

    def _hang(self, link: Link, frames: Mapping[int, Vec3], name: str) -> Any:
        """A body without mass on a joint of its parent."""
        joint = self._assembly.joints[link.joint]
        arm = swap(subtract(joint.pivot, frames[link.parent]))
        body = self._parts[link.parent].add_body()
        body.name, body.pos = name, arm
        body.add_site().name = str(link.joint)
        if joint.kind != "fixed" and not link.rigid:
            self._joints[link.joint] = self._joint(body, joint, link)
            self._apart.add((_name(link.parent), _name(link.part)))
        return body

    def _close(self, loop: Link, frames: Mapping[int, Vec3]) -> None:
        """A joint that closes a loop, from its part `a` to a twin of its part `b`, which has no
        shape and a share of that part's mass, and is welded to it."""
        part, pivot = self._assembly.parts[loop.part], self._assembly.joints[loop.joint].pivot
        twin = self._hang(loop, frames, f"twin {loop.joint}")
        self._weigh_part(twin, loop.part, pivot)
        anchor = swap(subtract(part.centre, frames[loop.part]))
        weld(self._spec, twin.name, _name(loop.part), anchor, self._step)

    def _weigh_part(self, body: Any, index: int, frame: Vec3) -> None:
        """Give a body with this frame the mass of a part, or its share of it."""
        part, share = self._assembly.parts[index], 1.0 / (1 + self._shares[index])
        arm, inertia = subtract(part.centre, frame), swap(part.inertia)
        _weigh(body, share * part.mass, scale(inertia, share), swap(arm))

    def _part(self, body: Any, index: int, frame: Vec3, shapes: Sequence[Shape]) -> None:
        """Mass and shapes of a part, in a body with this frame."""
        part = self._assembly.parts[index]
        self._parts[index] = body
        arm = subtract(part.centre, frame)
        self._weigh_part(body, index, frame)
        surface = Surface(part.friction, part.restitution, part.rolling_friction)
        for shape in shapes:
            at, cluster = add(arm, shape.offset), self._plan.cluster[index]
            geom = self._shapes.add(
                body, part.block, shape.kind, shape.size, at, shape.rotation, surface, cluster
            )
            if index in self._grabbers:
                geom.gap = TOUCH

    def _joint(self, body: Any, joint: Joint, link: Link) -> Any:
        """A joint with its motor or dry friction, spring and stops."""
        made = body.add_joint(name=str(link.joint), type=_KINDS[joint.kind])
        if joint.kind != "spherical":
            made.axis = joint_axis(joint, link)
        drive = merge_drives(self._assembly.joints, link)
        made.frictionloss = drive.command({}).limit
        made.solref_friction = _braking(self._step)
        made.solimp_friction = FIRM
        if drive.stops is not None:
            made.limited, made.range = True, list(drive.stops)
            made.solref_limit, made.solimp_limit = _fast(self._step), HARD
        if joint.kind == "prismatic":
            made.stiffness, made.damping = [drive.stiffness, 0, 0], [drive.damping, 0, 0]
        return made


def inertia_of(item: SceneObject) -> Vec3:
    """Principal moments of an object about its centre of mass, engine frame, kg m2."""
    x, y, z = swap(item.size)
    if item.balance == (0.0, 0.0, 0.0) and item.shape == "sphere":
        return (0.1 * item.mass * x * x,) * 3
    if item.balance == (0.0, 0.0, 0.0) and item.shape == "cylinder":
        across = item.mass * (0.75 * x * x + z * z) / 12.0
        return across, across, item.mass * x * x / 8.0
    twelfth = item.mass / 12.0
    return twelfth * (y * y + z * z), twelfth * (x * x + z * z), twelfth * (x * x + y * y)


def _name(body: int | str) -> str:
    """Name of the body of a part or a moving object."""
    return f"part {body}" if isinstance(body, int) else f"thing {body}"


def _weigh(body: Any, mass: float, inertia: Vec3, centre: Vec3 = (0.0, 0.0, 0.0)) -> None:
    """Set mass properties, engine frame; no shape adds to them."""
    body.explicitinertial = True
    body.mass, body.inertia, body.ipos = mass, inertia, centre
