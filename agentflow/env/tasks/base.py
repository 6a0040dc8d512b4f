"""Owns what a task is: parameters, scene, schedule, score, feedback.

One module per family builds on it; the rollout calls it; nothing here knows an engine.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import ClassVar, Protocol

from pydantic import BaseModel, ConfigDict

from agentflow.env.rollout import Broken, Feedback, Trace, Verdict
from agentflow.env.scene import Quat, Scene, Vec3
from agentflow.machine.brief import Brief
from agentflow.machine.tree import Machine

Body = int | str
"""A block id, a thing's name, or "ground"."""


class World(Protocol):
    """What a referee may look at after each step. Game frame."""

    @property
    def time(self) -> float:
        """Seconds since t = 0."""

    def centre(self, body: Body) -> Vec3:
        """Centre of a block or a thing, m."""

    def origin(self, block: int) -> Vec3:
        """Building point of a block, m."""

    def rotation(self, body: Body) -> Quat:
        """Orientation of a block or a thing."""

    def touching(self, body: Body) -> frozenset[Body]:
        """What a block or thing is in contact with in this step."""


class Referee(Protocol):
    """Watches one rollout step by step and gives its verdict at the end."""

    def start(self, world: World) -> None:
        """Called once at t = 0, when everything has settled."""

    def watch(self, world: World) -> None:
        """Called after every step from then on."""

    def verdict(self, trace: Trace) -> Verdict:
        """Score, terms and events of the whole window."""


@dataclass(frozen=True)
class Schedule:
    """Seconds since t = 0 at which actuators start."""

    motors: float = 0.0
    """Wheels, rotating and steering blocks, powered cogs, flying blocks."""
    springs: float = 0.0
    """Springs and winches."""
    steering_hinges: float = 0.0
    more: tuple[tuple[float, str, float], ...] = ()
    """Further switches: seconds, entry and level as `Engine.switch` takes them, or `decouplers`,
    which let go. At equal times they come last."""

    def switches(self) -> tuple[tuple[float, str, float], ...]:
        """All switches as seconds, entry and level, in order."""
        starts = (
            (self.motors, "motors", 1.0),
            (self.springs, "springs", 1.0),
            (self.springs, "winches", 1.0),
            (self.steering_hinges, "steering_hinges", 1.0),
        )
        return tuple(sorted((*starts, *self.more), key=lambda switch: switch[0]))


class Parameters(BaseModel):
    """Base of a family's knobs: frozen, ranged, unknown keys refused."""

    model_config = ConfigDict(frozen=True, extra="forbid")


@dataclass(frozen=True)
class Task(ABC):
    """One level of a family, ready to be simulated. Stateless: a referee holds the state."""

    family: ClassVar[str]
    name: str
    """"throwing" (level 1) or "throwing/3"."""
    level: int
    parameters: Parameters
    window: float = 5.0
    """Length of the scored window, s."""
    schedule: Schedule = field(default_factory=Schedule)

    @property
    @abstractmethod
    def brief(self) -> Brief:
        """What designers are told and what validity checks."""

    @abstractmethod
    def scene(self, machine: Machine | None = None) -> Scene:
        """Everything but the machine.

        Args:
            machine: What is going to stand there, for things whose place depends on it; None shows
                the level without one.
        """

    def trials(self, seed: int) -> tuple[Task, ...]:  # noqa: ARG002 - for those that have any
        """The rollouts that one try of a machine takes: this one, or variations of it.

        Every verdict of a variation has the terms that `trials.joined` counts, and a variation is
        its own only trial.

        Args:
            seed: Of the variations.
        """
        return (self,)

    @abstractmethod
    def referee(self, machine: Machine) -> Referee:
        """A fresh observer for one rollout of this machine."""

    @abstractmethod
    def feedback(
        self, machine: Machine, trace: Trace, broken: tuple[Broken, ...], verdict: Verdict
    ) -> Feedback:
        """The default feedback of spec 3.2."""
