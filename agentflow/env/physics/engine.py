"""The interface of a physics engine, in the game frame, and what starts one.

Each engine converts to its own frame.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from agentflow.errors import ConfigError, UsageError
from agentflow.machine.problems import size_of_piece

if TYPE_CHECKING:  # an engine's identity needs no physics
    from agentflow.env.constants import Constants
    from agentflow.env.physics.laws.forces import Entry
    from agentflow.env.physics.loads import Loads
    from agentflow.env.physics.model import Assembly, State
    from agentflow.env.physics.rows import Row
    from agentflow.env.rollout import Array
    from agentflow.env.scene import Body, Scene
    from agentflow.machine.geometry.vectors import Quat, Vec3

AUTO = "auto"
"""Name that stands for the default engine."""


class TooLargeError(UsageError):
    """The machine has more parts in one piece than the engine can hold."""

    def __init__(self, parts: int, limit: int, engine: str) -> None:
        self.problem = size_of_piece(parts, limit, engine)
        super().__init__(self.problem.message)


@dataclass(frozen=True)
class EngineIdentity:
    """Name and library version of an engine, which with the constants determine its rollouts."""

    name: str
    version: str

    def __str__(self) -> str:
        return f"{self.name} {self.version}"


class Touch(NamedTuple):
    """Two bodies that touch; blocks before objects, and of blocks the one with the smaller id.

    `force` (N) is the sum of the normal forces in the last step, `place` (m) where most of it acts.
    """

    a: Body
    b: Body
    place: Vec3
    force: float


class Watch(NamedTuple):
    """What a rollout looks at in every step; it calls steps calm in which it need not."""

    loads: Loads
    """They filter the loads."""
    change: tuple[float, float, float]
    """Greatest change of the greatest linear speed (m/s), angular speed (rad/s) and load over
    strength in a calm step."""
    speeds: tuple[float, float, float]
    """In a calm step, the greatest linear speed is at least the first of these (m/s) or the angular
    speed at least the second (rad/s), and the linear speed at most the third."""


class World(Protocol):
    """A running simulation of one machine in one scene. Equal calls give bitwise equal results.

    Blocks are named by their ids, objects by their names, the ground is "ground".
    """

    @property
    def reactions(self) -> Array:
        """(J, 6) force (N) and torque (N m, about the pivot) that part `a` exerts on part `b`
        through each joint, mean over the last step.

        0 for joints in none of the spanning trees of `spanning_tree.skeleton`, except those of its
        `loops`. A joint in the tree bears what those parallel to it bear as well, which includes
        the torque of their motors; for other joints that is left out. Axes: those of the child part
        in the tree, for loops those of part `b`; at rest they are those of the game frame.
        """

    @property
    def settle_rate(self) -> float:
        """Rate at which machines settle as they do at higher ones, Hz."""

    @property
    def calm(self) -> int:
        """How many parts of steps to come are taken already and known to be calm, so that nothing
        breaks in them."""

    @property
    def now(self) -> Any:
        """What there is until the next split: a `world.UnsplitMachine`."""

    def speeds(self, thorough: bool = True) -> tuple[float, float]:
        """Greatest linear and angular speed of anything that moves, m/s and rad/s; not finite when
        the simulation diverged.

        Args:
            thorough: Check every part; otherwise the engine may check only some, and give less
                than the greatest speeds.
        """

    def switch(self, entry: Entry, level: float) -> None:
        """Set what an entry drives: 1 starts it, 0 holds it, -1 runs it backwards.

        Args:
            entry: `motors` (thrusters too), `steering_hinges`, `springs`, `winches`, `grabbers`,
                `wind`, `loads` or `holds`; or the id of a block, if the machine has controls.
                Grabbers and wind are on from the start, and grabbers release at 0; the others are
                at 0. Gusts count the time for which the wind has been on. What is held is let go
                as `holds` comes to 1.
            level: Share of the full speed, thrust or load.
        """

    def drive(self, levels: Mapping[Entry, float], sudden: bool) -> None:
        """Set the levels of several blocks of a machine with controllers at once, which may happen
        in every step; `sudden` if they change much."""

    def step(self, divisions: int = 1, ahead: int = 1, watch: Watch | None = None) -> None:
        """Advance by 1 / (rate * divisions) seconds.

        Args:
            divisions: Into how many parts a step is divided.
            ahead: How many such parts, this one included, will follow each other before anything
                is switched or driven, as far as is known; an engine may take several at once.
            watch: What is looked at in every part. An engine that takes several at once filters
                the loads, tells those of `watch`, and stops where something breaks.
        """

    def split(self, broken: Sequence[int]) -> None:
        """Remove these joints, keeping every position and velocity."""

    def state(self) -> State:
        """Current positions and velocities."""

    def centres(self) -> Array:
        """(N, 3) block centres, m."""

    def snapshot(self) -> object:
        """The current state, in a form that only `states` and `energies` understand."""

    def states(self, snapshots: Sequence[object]) -> State:
        """At least one snapshot as states; every array has a leading axis of times."""

    def energies(self, snapshot: object) -> Array:
        """(N + M, 2) kinetic energy and energy of height above the ground, J, of every block, then
        of every moving object."""

    def contacts(self) -> list[Touch]:
        """Every pair of blocks or objects that touched in the last step, once."""

    def works(self) -> Array:
        """(S + 1, 3) work done from when the world was built until the end of each step, J.

        The columns are the work of springs and suspensions; of motors, winches and thrusters; and
        of the air on the blocks, which propeller blades turn to good use. Row 0 is before the
        first step.
        """

    def pulls(self) -> Mapping[int, tuple[Array, Array]]:
        """Spring or winch -> (S + 1,) its pull in each step, N, and its work from when the world
        was built until the end of each step, J. Row 0 is before the first step."""

    def centre(self, body: Body) -> Vec3:
        """Centre of a block or an object."""

    def rotation(self, body: Body) -> Quat:
        """Orientation of a block or an object."""

    def origin(self, block: int) -> Vec3:
        """Building point of a block."""

    def row(self, body: Body) -> Row:
        """The row of a block's cluster or of a moving object, in the engine's frame."""

    def part(self, part: int) -> Row:
        """The row of the cluster that a part belongs to, in the engine's frame."""

    def touching(self, body: Body) -> frozenset[Body]:
        """Everything that a block or object was in contact with in the last step."""

    def momentum(self) -> Mapping[str, Array]:
        """Total `linear` and `angular` momentum (about the world's origin) and kinetic `energy`
        of the machine."""


class Engine(Protocol):
    """Builds worlds. Only the latest one may be used: building another invalidates it."""

    @property
    def identity(self) -> EngineIdentity:
        """Recorded in every rollout of this engine."""

    def build(self, assembly: Assembly, scene: Scene, rate: float) -> World:
        """Build a world with the machine at the scene's start.

        An engine runs one world at a time: a new one may use the model of the one before.

        Args:
            assembly: The machine, on the ground above the origin.
            scene: Objects, ground, wind and start.
            rate: Steps per second.

        Raises:
            TooLargeError: The machine has more parts in one piece than the engine can hold.
        """

    def close(self) -> None:
        """Release the engine's resources; may be called twice."""


@dataclass(frozen=True)
class EngineSpec:
    """How to start an engine; its library is loaded only when it starts."""

    name: str
    libraries: tuple[str, ...]
    """Distributions that provide its library; the first installed one is used."""
    factory: str
    """"module:attribute" of a callable that makes the engine from its constants (or None: those of
    `constants.json`)."""
    most_parts: int | None = None
    """Most parts that it can hold in one piece of a machine; None: any number."""

    @cached_property
    def identity(self) -> EngineIdentity:
        """Name and library version, determined without loading the library.

        Raises:
            ConfigError: The library is not installed.
        """
        for distribution in self.libraries:
            try:
                return EngineIdentity(self.name, version(distribution))
            except PackageNotFoundError:
                continue
        needed = " or ".join(self.libraries)
        raise ConfigError(f"the physics engine {self.name!r} needs {needed}; install it")

    def start(self, physics: Constants | None = None) -> Engine:
        """Load the library and make an engine."""
        module, _, attribute = self.factory.partition(":")
        engine: Engine = getattr(import_module(module), attribute)(physics)
        return engine
