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
    """What files hold: read from them, it has no fields that are unknown here."""

    __pydantic_config__ = ConfigDict(extra="forbid")


class Hit(NamedTuple):
    """One time that two bodies came together."""

    time: float
    """Of the first touch."""
    place: Vec3
    """Where they pressed hardest in the first step."""
    impulse: float
    """Of the normal force until they came apart, at most over `logs.LONGEST`, N s."""


@dataclass(frozen=True)
class Contact(Recorded):
    """Two bodies that touched: blocks come before objects."""

    a: Named
    b: Named
    first: Hit
    hardest: Hit
    standing: bool
    """Whether they touched at t = 0."""
    last: float
    """Time at which they were last seen to touch."""


@dataclass(frozen=True)
class Peak(Recorded):
    """The greatest load of a connection in a part of the rollout, over every step."""

    block: int
    partner: int
    time: float
    load: float
    """Load over strength."""
    force: Vec3
    """That the partner exerts on the block, N. Axes: those of the block, which at rest are those
    of the machine frame."""
    moment: Vec3
    """About the joint, N m; axes as those of `force`."""
    after: bool
    """Whether it is that after the decisive moment, rather than the one up to it."""


@dataclass(frozen=True)
class Energy(Recorded):
    """Work done from t = 0 until a moment, and the kinetic energy then, J."""

    time: float
    springs: float
    """Work of springs and suspensions."""
    motors: float
    """Work of motors of joints, winches and thrusters."""
    gravity: float
    thrown: float
    """Kinetic energy of what is thrown, carried or pushed."""
    machine: float
    """Kinetic energy of all other blocks."""
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
    """What a spring or winch did until the time of `Energy`, over every step."""

    block: int
    work: float
    """Since t = 0, J."""
    force: float
    """Its greatest pull, N."""
    time: float
    """When that was, s."""


@dataclass(frozen=True)
class Drawn(Recorded):
    """What springs, motors, winches and thrusters gave from t = 0 on; what they took back does not
    count."""

    energy: float
    """J."""
    power: float
    """Greatest mean over 0.1 s, W."""
    time: float
    """When that was, s."""


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
