"""Parts, joints, machines and states, as engines receive and return them.

Game frame throughout (left-handed, y up), metres, kilograms, seconds, radians. At rest every part
is aligned with the machine frame, so parts store no orientation.
"""

from dataclasses import dataclass, field
from typing import Literal

from agentflow.env.physics.laws.flight import Heat, Thruster
from agentflow.env.physics.laws.forces import Entry
from agentflow.env.physics.laws.motion import MotionDevice
from agentflow.env.physics.laws.tension import Spring, Winch
from agentflow.env.rollout import Array
from agentflow.machine.geometry.vectors import IDENTITY, Quat, Vec3

Color = tuple[float, float, float, float]
JointKind = Literal["fixed", "revolute", "prismatic", "spherical"]


@dataclass(frozen=True)
class Shape:
    """A primitive shape of a part. `size` and `rotation` as in `scene.SceneObject`."""

    kind: Literal["box", "sphere", "cylinder"]
    size: Vec3
    offset: Vec3 = (0.0, 0.0, 0.0)
    """From the part's centre of mass to the shape's centre."""
    rotation: Quat = IDENTITY
    solid: bool = True
    """Whether it collides; otherwise it is only drawn."""


@dataclass(frozen=True)
class Part:
    """A rigid body: a block, half of a two-ended block, or the fork or wheel of a caster.

    `inertia` are its principal moments about `centre`, its centre of mass at rest, along the axes
    of the machine frame. Drag takes mass * `linear_drag` * velocity, and the like of its spin; in
    1/s.
    """

    block: int
    centre: Vec3
    mass: float
    inertia: Vec3
    shapes: tuple[Shape, ...] = ()
    friction: float = 0.0
    restitution: float = 0.0
    rolling_friction: float = 0.0
    linear_drag: float = 0.0
    angular_drag: float = 0.0
    extents: Vec3 = (0.0, 0.0, 0.0)
    """Box exposed to the wind, at rest; 0 for two-ended blocks and for propellers, on which the air
    acts by the blade law alone."""
    color: Color = (0.7, 0.7, 0.7, 1.0)


@dataclass(frozen=True)
class Drive:
    """Motor, spring-damper, dry friction and stops of a joint.

    Once it is switched on, the motor aims at `speed` about the joint's axis, with at most `torque`,
    N m; speed 0 holds. Without a torque, the joint turns freely, but for its dry `friction`, N m.
    Prismatic joints have `stiffness`, N/m, and `damping`, N s/m. `stops` are the lowest and the
    highest position.
    """

    speed: float = 0.0
    torque: float = 0.0
    starts: Entry = "motors"
    """The entry whose level it follows: one of the task's schedule, `motors`, `steering_hinges` or
    `decouplers`, which release a rigid joint; or the id of its block, which controls drive."""
    friction: float = 0.0
    stiffness: float = 0.0
    damping: float = 0.0
    stops: tuple[float, float] | None = None


@dataclass(frozen=True)
class Strength:
    """Greatest force (N) and torque (N m) that a connection bears."""

    force: float
    torque: float


@dataclass(frozen=True)
class Joint:
    """A connection of two parts: part `b` hangs on part `a`. It belongs to `block`; `partner` is
    the other block."""

    block: int
    partner: int
    a: int
    b: int
    kind: JointKind = "fixed"
    pivot: Vec3 = (0.0, 0.0, 0.0)
    axis: Vec3 = (0.0, 0.0, 1.0)
    """Unit vector at rest; positive positions turn `b` against `a` about it (or move along it)."""
    strength: Strength | None = None
    """None: it never breaks and is not a connection in traces."""
    extra: bool = False
    """Brace end or auto-connection: not part of the construction tree."""
    drive: Drive = field(default_factory=Drive)


@dataclass(frozen=True)
class Gripper:
    """A grabber: grips the first movable body that touches its front, and holds it with at most
    `force`.

    Its front is at `reach` from the part's centre, along the unit vector `front`; `starts` as in
    `Drive`.
    """

    part: int
    front: Vec3
    reach: float
    force: float
    joined: frozenset[int] = frozenset()
    """Parts that it was attached to; it does not grip them when they break off."""
    starts: Entry = "grabbers"


@dataclass(frozen=True)
class CogMesh:
    """Two cogs that mesh: the position of the joint with index `a` is -ratio times that of `b`."""

    a: int
    b: int
    ratio: float


@dataclass(frozen=True)
class Devices:
    """Everything in a machine that acts on its parts other than through joints."""

    springs: tuple[Spring, ...] = ()
    thrusters: tuple[Thruster, ...] = ()
    flames: tuple[Heat, ...] = ()
    moved: tuple[MotionDevice, ...] = ()
    """Those that push their part as it moves."""
    winches: tuple[Winch, ...] = ()
    grippers: tuple[Gripper, ...] = ()
    cog_meshes: tuple[CogMesh, ...] = ()


@dataclass(frozen=True)
class Assembly:
    """A whole machine as parts and joints, placed in the world as the rollout starts.

    `origins` are the building points of all blocks at rest (of two-ended blocks, the middle between
    the ends), `centres` those of their boxes, and `rotations` their orientations.
    """

    parts: tuple[Part, ...]
    joints: tuple[Joint, ...]
    blocks: tuple[tuple[int, ...], ...]
    """Part indices of each block; the first carries its pose."""
    origins: tuple[Vec3, ...]
    centres: tuple[Vec3, ...]
    rotations: tuple[Quat, ...]
    spans: tuple[tuple[int, int, int], ...] = ()
    """(block, part, part) of each two-ended block: its id and its ends."""
    devices: Devices = field(default_factory=Devices)


@dataclass(frozen=True)
class State:
    """Positions and velocities of N blocks, M moving objects and L two-ended blocks; game frame.

    (N, 3): `position` of block origins, `centre`, `velocity` of the centres and `angular_velocity`;
    (N, 4): `rotation`; (L,): `length`. Objects have the like, (M, 3) and (M, 4).
    """

    position: Array
    centre: Array
    rotation: Array
    velocity: Array
    angular_velocity: Array
    length: Array
    object_position: Array
    object_rotation: Array
    object_velocity: Array
