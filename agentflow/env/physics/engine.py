"""The interface of a physics engine, in the game frame; each engine converts to its own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from agentflow.errors import UsageError

if TYPE_CHECKING:  # an engine's identity needs no physics
    from agentflow.env.physics.model import Assembly, State
    from agentflow.env.rollout import Array
    from agentflow.env.scene import Quat, Scene, Vec3
    from agentflow.env.tasks.base import Body


class TooLargeError(UsageError):
    """The machine has more parts in one piece than the engine can hold."""


@dataclass(frozen=True)
class EngineIdentity:
    """What decides, beside the constants, how an engine moves a machine."""

    name: str
    """As users write it."""
    version: str
    """Of the library that does the physics."""

    def __str__(self) -> str:
        return f"{self.name} {self.version}"


class Engine(Protocol):
    """One world at a time. Everything is deterministic, bit by bit, for equal calls."""

    @property
    def identity(self) -> EngineIdentity:
        """What rollouts of this engine record."""

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
