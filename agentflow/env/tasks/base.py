"""The task interface: parameters, scene, schedule, referee and feedback of one level; and the axes
along which searches keep different machines.

Pure functions of a machine and its rollout. A family declares the two or three that suit it; the
ranges and numbers of cells are choices of ours.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar, Protocol

from pydantic import BaseModel, ConfigDict

from agentflow.env.feedback.separation import sample_at
from agentflow.env.mechanism import DRIVES, classify, moment_of, payload_of, work_shares
from agentflow.env.physics.engine import AUTO
from agentflow.env.physics.laws.forces import Entry
from agentflow.env.rollout import Broken, Feedback, Rollout, Trace, Verdict
from agentflow.env.scene import Body, Scene
from agentflow.env.tasks.guard import guard_family
from agentflow.machine.blocks.library import library
from agentflow.machine.brief import Brief
from agentflow.machine.controls import GROUPS
from agentflow.machine.controls import switches as control_switches
from agentflow.machine.geometry.balance import mass
from agentflow.machine.geometry.placement import place
from agentflow.machine.geometry.vectors import Quat, Vec3
from agentflow.machine.tree import Machine
from agentflow.search.elites.axes import Axis, Measurement


@dataclass(frozen=True)
class Descriptor:
    """One property and how it is measured; None if a rollout does not show it."""

    axis: Axis
    measure: Callable[[Machine, Rollout], float | None]


def measure(
    descriptors: Sequence[Descriptor], machine: Machine, rollout: Rollout
) -> tuple[Measurement, ...]:
    """What a machine measures on every axis; no values unless its simulation ended well."""
    done = rollout.status == "ok"
    return tuple(
        Measurement(item.axis, item.measure(machine, rollout) if done else None)
        for item in descriptors
    )


def count_blocks(machine: Machine, rollout: Rollout) -> float:  # noqa: ARG001
    """Number of blocks."""
    return float(len(machine))


def weigh(machine: Machine, rollout: Rollout) -> float:  # noqa: ARG001
    """Mass of all blocks, kg."""
    return mass(place(machine))


def number_drive(machine: Machine, rollout: Rollout) -> float | None:
    """Number of the drive of the mechanism class in `mechanism.DRIVES`."""
    mechanism = classify(machine, rollout)
    return None if mechanism is None else float(DRIVES.index(mechanism.drive))


def share_of(source: str) -> Callable[[Machine, Rollout], float | None]:
    """The function that measures the share of one source in the work put in; see `work_shares`.

    A rollout with less than 1 J of work has share 0 of every source.
    """

    def share(machine: Machine, rollout: Rollout) -> float | None:  # noqa: ARG001
        energy = None if rollout.trace is None else rollout.trace.measured.energy
        return None if energy is None else (work_shares(energy) or {source: 0.0})[source]

    return share


def release_height(machine: Machine, rollout: Rollout) -> float | None:
    """Height of the payload's centre at its release, m; of a payload that stays, at t = 0."""
    trace, payload = rollout.trace, payload_of(machine, rollout)
    if trace is None or not isinstance(payload, int):
        return None
    return float(trace.centre[sample_at(trace, moment_of(rollout).get("time", 0.0)), payload, 1])


def count_driven_wheels(machine: Machine, rollout: Rollout) -> float:  # noqa: ARG001
    """Number of powered wheels."""
    return float(sum(library()[step.type].powered_wheel for step in machine))


def wheelbase(machine: Machine, rollout: Rollout) -> float:  # noqa: ARG001
    """Distance along z between the centres of the foremost and the rearmost wheel as built, m.

    0 with fewer than two wheels.
    """
    wheels = [item for item in place(machine).blocks if library()[item.type].category == "Wheel"]
    along = [item.center[2] for item in wheels]
    return max(along) - min(along) if along else 0.0


ON_WHEELS = (
    Descriptor(Axis("number of powered wheels", "", -0.5, 11.5, 12), count_driven_wheels),
    Descriptor(Axis("wheelbase", "m", 0.0, 16.0, 8), wheelbase),
)
"""For families whose machines drive."""
GENERAL = (
    Descriptor(Axis("number of blocks", "", 0.0, 40.0, 8), count_blocks),
    Descriptor(Axis("mass", "kg", 0.0, 40.0, 8), weigh),
    Descriptor(Axis.of_categories("drive", DRIVES), number_drive),
)
"""For families without their own; 40 is the usual budget of blocks, most of which weigh 1 kg at
most."""


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

    def fault(self, machine: Machine) -> str:  # noqa: ARG002 - few levels demand more
        """Why no simulation of a valid machine can succeed, which builders see before a test; "" if
        that is not known."""
        return ""

    @abstractmethod
    def referee(self, machine: Machine) -> Referee:
        """A new referee for one rollout of this machine."""

    @abstractmethod
    def feedback(
        self, machine: Machine, trace: Trace, broken: tuple[Broken, ...], verdict: Verdict
    ) -> Feedback:
        """The feedback that designers receive after a rollout."""
