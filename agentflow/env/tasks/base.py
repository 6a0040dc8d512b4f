"""The task interface: parameters, scene, schedule, referee and feedback of one level."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar, Protocol

from pydantic import BaseModel, ConfigDict

from agentflow.env.physics.engine import AUTO
from agentflow.env.physics.laws.forces import Entry
from agentflow.env.rollout import Broken, Feedback, Trace, Verdict
from agentflow.env.scene import Body, Scene
from agentflow.env.tasks.descriptors import GENERAL, Descriptor
from agentflow.env.tasks.guard import guard_family
from agentflow.machine.brief import Brief
from agentflow.machine.controls import GROUPS
from agentflow.machine.controls import switches as control_switches
from agentflow.machine.geometry.vectors import Quat, Vec3
from agentflow.machine.tree import Machine

ROUNDING = 1e-6
"""Tolerance for the rounding error of summed time steps, s."""


Switch = tuple[float, Entry, float]
"""Seconds since t = 0, what is switched, and its level from then on."""


def drives_blocks(entry: Entry) -> bool:
    """Whether an entry drives blocks of the machine: one of them, or a group."""
    return isinstance(entry, int) or entry in GROUPS


class WorldView(Protocol):
    """What a referee can read after each step. Game frame."""

    @property
    def time(self) -> float:
        """Seconds since t = 0."""

    @property
    def levels(self) -> Mapping[Entry, float]:
        """Level of each entry that was switched, as for `World.switch`."""

    def centre(self, body: Body) -> Vec3:
        """Centre of a block or scene object, m."""

    def origin(self, block: int) -> Vec3:
        """Building point of a block, m."""

    def rotation(self, body: Body) -> Quat:
        """Orientation of a block or scene object."""

    def touching(self, body: Body) -> frozenset[Body]:
        """Bodies in contact with a block or scene object in this step."""


class Referee(Protocol):
    """Observes one rollout step by step and scores it at the end."""

    def start(self, world: WorldView) -> None:
        """Called once at t = 0, after settling."""

    def watch(self, world: WorldView) -> bool | None:
        """Called after every later step; True ends the window, as nothing later would count."""

    def verdict(self, trace: Trace) -> Verdict:
        """Score, terms and events of the whole window."""


@dataclass(frozen=True)
class Schedule:
    """Start times of actuators, in seconds since t = 0."""

    motors: float = 0.0
    """Wheels, rotating and steering blocks, powered cogs, flying blocks."""
    springs: float = 0.0
    """Springs and winches."""
    steering_hinges: float = 0.0
    more: tuple[tuple[float, str, float], ...] = ()
    """Additional switches: seconds, entry and level as for `World.switch` in physics/engine.py, or
    `decouplers` to release them. They are applied after the others at the same time."""
    designed: bool = False
    """Whether machines may bring controls of their own, which then replace all of this."""
    trials: int = 1
    """Rollouts of a design; after each but the last, its controls alone may be revised."""

    def switches(self) -> tuple[Switch, ...]:
        """All switches as (seconds, entry, level), in order of time."""
        starts = (
            (self.motors, "motors", 1.0),
            (self.springs, "springs", 1.0),
            (self.springs, "winches", 1.0),
            (self.steering_hinges, "steering_hinges", 1.0),
        )
        return tuple(sorted((*starts, *self.more), key=lambda switch: switch[0]))


class Parameters(BaseModel):
    """Base class of knob groups: frozen, range-checked, no unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid")


@dataclass(frozen=True)
class Task(ABC):
    """One level of a family, ready to simulate. Stateless: the referee holds the state."""

    family: ClassVar[str]
    descriptors: ClassVar[tuple[Descriptor, ...]] = GENERAL
    """Properties in which machines for the family differ, for searches that keep different ones."""
    name: str
    """"throwing" (level 1) or "throwing/3"."""
    level: int
    parameters: Parameters
    window: float = 5.0
    """Length of the scored window, s."""
    schedule: Schedule = field(default_factory=Schedule)
    engine: str = AUTO
    """Name of the physics engine that simulates it, and whose limits its machines must keep."""

    def __init_subclass__(cls) -> None:
        guard_family(cls)

    def switches(self, machine: Machine) -> tuple[Switch, ...]:
        """What is switched when: by the machine's own controls, else by the schedule, which also
        switches what the scene adds."""
        switches = self.schedule.switches()
        if not machine.controlled:
            return switches
        scene = (item for item in switches if not drives_blocks(item[1]))
        return tuple(sorted((*control_switches(machine), *scene), key=lambda item: item[0]))

    @property
    def sensing(self) -> tuple[float, int]:
        """Of what sensors read: noise as a share of it, and delay in readings."""
        return 0.0, 0

    @property
    def unit(self) -> str:
        """Of its scores; "" if they are plain numbers."""
        return ""

    @property
    @abstractmethod
    def brief(self) -> Brief:
        """Description for designers, and the constraints that validation checks."""

    @abstractmethod
    def scene(self, machine: Machine | None = None) -> Scene:
        """Everything but the machine.

        Args:
            machine: The machine to simulate, for objects placed relative to it; None gives the
                level without a machine.
        """

    def trials(self, seed: int) -> tuple[Task, ...]:  # noqa: ARG002 - used by trial families
        """The rollouts needed to evaluate a machine once: this task, or variations of it.

        The verdict of a variation has the terms `success`, `outcome` and `miss`; the only trial of
        a variation is itself.

        Args:
            seed: Random seed of the variations.
        """
        return (self,)

    @abstractmethod
    def referee(self, machine: Machine) -> Referee:
        """A new referee for one rollout of this machine."""

    @abstractmethod
    def feedback(
        self, machine: Machine, trace: Trace, broken: tuple[Broken, ...], verdict: Verdict
    ) -> Feedback:
        """The feedback that designers receive after a rollout."""
