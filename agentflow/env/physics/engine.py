"""Owns the engine interface and the vocabulary in which a world is described to an engine.

Game frame throughout (left-handed, y up), metres, kilograms, seconds, radians. At rest every part
is aligned with the machine frame, so a part needs no orientation of its own; each engine converts
to its own frame and nobody else knows that one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, Protocol

from agentflow.env.physics.actors import Actors
from agentflow.env.rollout import Array
from agentflow.env.scene import IDENTITY, Quat, Scene, Vec3
from agentflow.env.tasks.base import Body
from agentflow.errors import UsageError


class TooLargeError(UsageError):
    """The machine has more parts in one piece than the engine can hold."""


Color = tuple[float, float, float, float]
JointKind = Literal["fixed", "revolute", "prismatic", "spherical"]


@dataclass(frozen=True)
class Shape:
    """A piece of a part's surface. `size` and `rotation` as in `scene.Thing`."""

    kind: Literal["box", "sphere", "cylinder"]
    size: Vec3
    """Full extents before `rotation`; a sphere's diameter is `size[0]`; a cylinder's axis is y."""
    offset: Vec3 = (0.0, 0.0, 0.0)
    """From the part's centre of mass to the shape's centre."""
    rotation: Quat = IDENTITY
    solid: bool = True
    """Whether it collides; otherwise it is only seen."""


@dataclass(frozen=True)
class Part:
    """A rigid piece: a block, half of a two-ended block, or one half of a caster."""

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
    """Box that the wind sees, at rest; two-ended blocks offer none, nor do propellers, whose blade
    law is all that the air does to them."""
    color: Color = (0.7, 0.7, 0.7, 1.0)


@dataclass(frozen=True)
class Drive:
    """What a moving joint does by itself: a motor, a spring-damper, stops."""

    speed: float = 0.0
    """Velocity target once it is switched on, rad/s about the joint's axis; 0 holds."""
    torque: float = 0.0
    """Most torque the motor gives, N m; without torque the joint turns freely."""
    starts: Literal["motors", "steering_hinges", "decouplers"] = "motors"
    """The schedule entry that switches it on; `decouplers` part a rigid joint."""
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
    """What a connection bears."""

    force: float
    """N."""
    torque: float
    """N m."""


@dataclass(frozen=True)
class Joint:
    """What connects two parts. `block` is whose connection it is; `b` hangs on `a`."""

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
    """None never breaks and does not count as a connection in a trace."""
    extra: bool = False
    """Brace end or auto-connection: not part of the construction tree itself."""
    drive: Drive = field(default_factory=Drive)


@dataclass(frozen=True)
class Pull:
    """A spring: pulls two parts together along the line between their centres."""

    block: int
    a: int
    b: int
    natural: float
    """Length at which the pull is gone, m."""
    ramp: float
    """Beyond the natural length the pull grows to `force` over this length, m."""
    force: float
    damping: float


@dataclass(frozen=True)
class Assembly:
    """A whole machine as parts and joints, placed in the world as the rollout starts."""

    parts: tuple[Part, ...]
    joints: tuple[Joint, ...]
    pulls: tuple[Pull, ...]
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
    actors: Actors = field(default_factory=Actors)
    """What acts beside joints and springs."""


@dataclass(frozen=True)
class State:
    """Where everything is. N blocks, M moving things, L two-ended blocks; game frame."""

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
    thing_position: Array
    """(M, 3) m."""
    thing_rotation: Array
    """(M, 4)."""
    thing_velocity: Array
    """(M, 3) m/s."""


class Engine(Protocol):
    """One world at a time. Everything is deterministic, bit by bit, for equal calls."""

    @property
    def moving_things(self) -> tuple[str, ...]:
        """Names of the scene's things that can move, in scene order."""

    @property
    def reactions(self) -> Array:
        """(J, 6) force (N) and torque (N m, about the pivot) that `a` exerts on `b` through each
        joint of the spanning trees (tree.py) in the last step, 0 for the others; along the axes
        of the part that hangs on the other, right-handed and z up."""

    @property
    def top_speeds(self) -> tuple[float, float]:
        """Greatest linear and angular speed of anything that moves, m/s and rad/s; not finite
        when the simulation diverged."""

    @property
    def head_speeds(self) -> tuple[float, float]:
        """The same of one part of each piece of the machine, and of things: a quick look."""

    @property
    def locked(self) -> tuple[int, ...]:
        """Moving joints that cannot move because rigid connections bridge them."""

    def build(self, assembly: Assembly, scene: Scene, rate: float) -> None:
        """Make a fresh world.

        Raises:
            TooLargeError: The machine has more parts in one piece than the engine can hold.
        """

    def switch(self, entry: str, level: float) -> None:
        """Set what a schedule entry controls: 1 starts it, 0 holds it, -1 runs it backwards.

        Args:
            entry: `motors` (thrusters too), `steering_hinges`, `springs`, `winches`, `grabbers`
                or `gusts`. Grabbers grip from the beginning and let go at 0; the others hold. A
                scene's gusts count their time from being switched on.
            level: Share of the full speed or thrust.
        """

    def step(self) -> None:
        """Advance by one step, then read everything once.

        For `start_time` after a switch that starts motors the engine may take finer steps, for
        one of these: what they swing is up to speed within hundredths of a second, and may hit
        what it is to throw in the middle of a step.
        """

    def split(self, broken: Sequence[int]) -> None:
        """Remove these joints and rebuild what they held, keeping every position and velocity."""

    def state(self) -> State:
        """Everything that a record holds."""

    def centres(self) -> Array:
        """(N, 3) block centres, as in `state` but without the rest."""

    def keep(self) -> None:
        """Keep the present state for `kept`."""

    def kept(self) -> State:
        """All states kept since `build`, every array with a leading axis of times; at least one."""

    def centre(self, body: Body) -> Vec3:
        """Centre of a block or a thing."""

    def rotation(self, body: Body) -> Quat:
        """Orientation of a block or a thing."""

    def origin(self, block: int) -> Vec3:
        """Building point of a block."""

    def touching(self, body: Body) -> frozenset[Body]:
        """What a block or thing is in contact with in this step."""

    def momentum(self) -> Mapping[str, Array]:
        """Total `linear` and `angular` momentum (about the world's origin) and kinetic `energy`
        of the machine."""
