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
    """Full extents before `rotation`; a sphere's diameter is `size[0]`; a cylinder's axis is y."""
    offset: Vec3 = (0.0, 0.0, 0.0)
    """From the part's centre of mass to the shape's centre."""
    rotation: Quat = IDENTITY
    solid: bool = True
    """Whether it collides; otherwise it is only drawn."""


@dataclass(frozen=True)
class Part:
    """A rigid body: a block, half of a two-ended block, or the fork or wheel of a caster."""

    block: int
    centre: Vec3
    """Centre of mass at rest."""
    mass: float
    inertia: Vec3
    """Principal moments about the centre of mass, along the axes of the machine frame at rest."""
    shapes: tuple[Shape, ...] = ()
    friction: float = 0.0
    restitution: float = 0.0
    rolling_friction: float = 0.0
    linear_drag: float = 0.0
    """1/s: the part loses mass * drag * velocity."""
    angular_drag: float = 0.0
    """1/s, about its own centre."""
    extents: Vec3 = (0.0, 0.0, 0.0)
    """Box exposed to the wind, at rest; 0 for two-ended blocks and for propellers, on which the air
    acts by the blade law alone."""
    color: Color = (0.7, 0.7, 0.7, 1.0)


@dataclass(frozen=True)
class Drive:
    """Motor, spring-damper, dry friction and stops of a joint."""

    speed: float = 0.0
    """Velocity target once it is switched on, rad/s about the joint's axis; 0 holds."""
    torque: float = 0.0
    """Greatest torque of the motor, N m; with 0 the joint turns freely."""
    starts: Entry = "motors"
    """The entry whose level it follows: one of the task's schedule, `motors`, `steering_hinges` or
    `decouplers`, which release a rigid joint; or the id of its block, which controls drive."""
    friction: float = 0.0
    """Dry friction of a joint without motor, N m."""
    stiffness: float = 0.0
    """N/m, of a prismatic joint."""
    damping: float = 0.0
    """N s/m, of a prismatic joint."""
    stops: tuple[float, float] | None = None
    """Lowest and highest joint position."""


@dataclass(frozen=True)
class Strength:
    """Greatest load that a connection bears."""

    force: float
    """N."""
    torque: float
    """N m."""


@dataclass(frozen=True)
class Joint:
    """A connection of two parts; it belongs to `block`, and `b` hangs on `a`."""

    block: int
    partner: int
    """The other block."""
    a: int
    """Part index."""
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
    """A grabber: grips the first movable body that touches its front."""

    part: int
    front: Vec3
    """Unit vector."""
    reach: float
    """m from the part's centre to its front."""
    force: float
    """Greatest force with which it holds, N."""
    joined: frozenset[int] = frozenset()
    """Parts that it was attached to; it does not grip them when they break off."""
    starts: Entry = "grabbers"
    """The entry whose level it follows; as of drives."""


@dataclass(frozen=True)
class CogMesh:
    """Two cogs that mesh: the position of joint `a` is -ratio times that of `b`."""

    a: int
    """Joint index."""
    b: int
    """Joint index."""
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
    """A whole machine as parts and joints, placed in the world as the rollout starts."""

    parts: tuple[Part, ...]
    joints: tuple[Joint, ...]
    blocks: tuple[tuple[int, ...], ...]
    """Part indices of each block; the first carries its pose."""
    origins: tuple[Vec3, ...]
    """Building point of each block at rest (two-ended: middle between its ends)."""
    centres: tuple[Vec3, ...]
    """Box centre of each block at rest."""
    rotations: tuple[Quat, ...]
    """Orientation of each block at rest."""
    spans: tuple[tuple[int, int, int], ...] = ()
    """(block, part, part) of each two-ended block: its id and its ends."""
    devices: Devices = field(default_factory=Devices)


@dataclass(frozen=True)
class State:
    """Positions and velocities. N blocks, M moving objects, L two-ended blocks; game frame."""

    position: Array
    """(N, 3) block origins, m."""
    centre: Array
    """(N, 3) block centres, m."""
    rotation: Array
    """(N, 4)."""
    velocity: Array
    """(N, 3) of the centres, m/s."""
    angular_velocity: Array
    """(N, 3) rad/s."""
    length: Array
    """(L,) m."""
    object_position: Array
    """(M, 3) m."""
    object_rotation: Array
    """(M, 4)."""
    object_velocity: Array
    """(M, 3) m/s."""
