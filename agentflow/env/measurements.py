"""What is measured in every step of a rollout, not only at its samples.

World frame; metres, seconds, newtons, joules.
"""

from dataclasses import dataclass
from typing import NamedTuple

from pydantic import ConfigDict

from agentflow.machine.geometry.vectors import Vec3

Named = int | str
"""A block id, the name of an object of the scene, or "ground"."""


class Recorded:
    """Base of what files hold; reading refuses unknown fields."""

    __pydantic_config__ = ConfigDict(extra="forbid")


class Hit(NamedTuple):
    """One time that two bodies came together: when they first touched, the place where they pressed
    hardest in the first step, and the impulse of the normal force until they came apart, at most
    over `logs.LONGEST`, N s."""

    time: float
    place: Vec3
    impulse: float


@dataclass(frozen=True)
class Contact(Recorded):
    """Two bodies that touched: blocks come before objects.

    `standing` tells whether they touched at t = 0, `last` when they were last seen to touch.
    """

    a: Named
    b: Named
    first: Hit
    hardest: Hit
    standing: bool
    last: float


@dataclass(frozen=True)
class Peak(Recorded):
    """The greatest load of a connection in a part of the rollout, over every step.

    `load` is over strength. `force` (N) is what the partner exerts on the block, `moment` (N m) is
    about the joint; their axes are those of the block, which at rest are those of the machine
    frame. `after` tells whether it is the peak after the decisive moment, rather than the one up to
    it.
    """

    block: int
    partner: int
    time: float
    load: float
    force: Vec3
    moment: Vec3
    after: bool


@dataclass(frozen=True)
class Energy(Recorded):
    """Work done from t = 0 until a moment, and the kinetic energy then, J.

    Suspensions count as springs, joints, winches and thrusters as motors. `thrown` is the energy of
    what is thrown, carried or pushed, `machine` that of all other blocks.
    """

    time: float
    springs: float
    motors: float
    gravity: float
    thrown: float
    machine: float
    air: float = 0.0
    """Work of the air on the blocks: drag takes, wind and propeller blades can give. 0 in records
    from before it was measured, whose `lost` includes it."""

    @property
    def lost(self) -> float:
        """What friction, dampers, impacts and breakages took, less what the engine's steps add."""
        given = self.springs + self.motors + self.gravity + self.air
        return given - self.thrown - self.machine


@dataclass(frozen=True)
class Pull(Recorded):
    """What a spring or winch did until the time of `Energy`, over every step: its work since t = 0,
    and its greatest pull with its time; J, N, s."""

    block: int
    work: float
    force: float
    time: float


@dataclass(frozen=True)
class Drawn(Recorded):
    """What springs, motors, winches and thrusters gave from t = 0 on; what they took back does not
    count.

    `power` is the greatest mean over 0.1 s (W), and `time` when that was.
    """

    energy: float
    power: float
    time: float


@dataclass(frozen=True)
class Measured(Recorded):
    """All that was measured in one rollout."""

    contacts: tuple[Contact, ...] = ()
    """In order of the first touch."""
    peaks: tuple[Peak, ...] = ()
    """Up to and after the decisive moment, each with the greatest load first."""
    energy: Energy | None = None
    recoil: tuple[Peak, ...] = ()
    """Those within `logs.RECOIL` after the decisive moment."""
    pulls: tuple[Pull, ...] = ()
    """In order of block."""
    drawn: Drawn | None = None
    """None in files from before it was measured."""
    greatest: Peak | None = None
    """The greatest load of all connections while they held. Unlike `peaks`, it leaves out what a
    change of the step's length does to a machine at rest."""
