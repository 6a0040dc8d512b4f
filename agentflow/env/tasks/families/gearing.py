"""The gearing family: place cogs on a plate so that target cogs turn as required."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

from pydantic import model_validator

from agentflow.env.constants import constants
from agentflow.env.feedback.compose import compose
from agentflow.env.feedback.text import number
from agentflow.env.rollout import Broken, Feedback, Trace, Verdict
from agentflow.env.scene import Scene
from agentflow.env.tasks.base import Parameters
from agentflow.env.tasks.family import CommonKnobs, Family
from agentflow.env.tasks.features.turning import HOLD, MIN_SPEED, SOURCE, GearingReferee, Sense
from agentflow.env.tasks.knobs import choice, knob
from agentflow.errors import ConfigError
from agentflow.machine.blocks.library import library
from agentflow.machine.blocks.types import GRID, HOLE, HOLES, PATTERNS, SIZES, THICKNESS, Plate
from agentflow.machine.brief import Brief
from agentflow.machine.geometry.gears import GearTrain, gear_trains, meshing_pairs
from agentflow.machine.geometry.placement import place
from agentflow.machine.tree import Machine, Step

MEDIUM, POWERED, LARGE = 38, 39, 51
BLOCKS = (MEDIUM, LARGE)


class PlateKnobs(Parameters):
    """The plate."""

    size: int = knob(9, *SIZES, "m", "width of the plate along x and z")
    holes: int = knob(0, *HOLES, "", "number of square holes, 2 m wide")
    pattern: int = knob(0, *PATTERNS, "", "arrangement of the holes")


class Targets(Parameters):
    """Which cogs must turn, and in which direction."""

    count: int = knob(1, 1, 2, "", "number of target cogs")
    spread: int = knob(8, 2, 24, "m", "distance between two targets, along x")
    turn: Sense = choice(
        "with", "with or against", "direction of the first target, with or against the source"
    )
    second: Sense = choice("with", "with or against", "direction of the second target")


class GearingKnobs(CommonKnobs):
    """Knobs of a gearing level."""

    plate: PlateKnobs = PlateKnobs()
    distance: int = knob(4, 2, 28, "m", "distance from the source to the targets, along z")
    target: Targets = Targets()

    @property
    def base(self) -> Plate:
        """The plate."""
        plate = self.plate
        return Plate(plate.size, plate.holes, plate.pattern if plate.holes else 0)

    @property
    def source(self) -> tuple[float, float]:
        """x and z of the driven cog, m; the targets are as far beyond the plate's middle."""
        return 0.0, -round(self.distance / 2 / GRID) * GRID

    @property
    def targets(self) -> tuple[tuple[float, float], ...]:
        """x and z of each target, m."""
        z = self.source[1] + self.distance
        if self.target.count == 1:
            return ((0.0, z),)
        left = -round(self.target.spread / 2 / GRID) * GRID
        return ((left, z), (left + self.target.spread, z))

    @property
    def senses(self) -> tuple[Sense, ...]:
        """Required direction of each target."""
        return (self.target.turn, self.target.second)[: self.target.count]

    @property
    def faces(self) -> tuple[int, ...]:
        """Plate faces that carry source and targets."""
        return tuple(self.base.face(x, z) for x, z in (self.source, *self.targets))

    @model_validator(mode="after")
    def _fits(self) -> GearingKnobs:
        if len(self.base.hole_centres) < self.base.holes:
            most = len(self.base.hole_centres)
            raise ConfigError(
                f"plate.holes is {self.base.holes}; on a plate {self.base.size} m wide it must be "
                f"from 0 to {most}"
            )
        try:
            _ = self.faces
        except ConfigError as problem:
            raise ConfigError(f"source and targets do not fit on the plate: {problem}") from None
        return self


@dataclass(frozen=True)
class Gearing(Family):
    """Score: 1 if every target turns as required, at 0.5 rad/s or more, for one second; else 0."""

    family: ClassVar[str] = "gearing"
    knobs: ClassVar[type[CommonKnobs]] = GearingKnobs
    stays: ClassVar[bool] = True
    parameters: GearingKnobs

    @property
    def given(self) -> Machine:
        """Plate, source and targets: the start of every machine."""
        knobs = self.parameters
        kinds = (POWERED, *(MEDIUM for _ in knobs.targets))
        cogs = zip(kinds, knobs.faces, strict=True)
        return Machine(
            (
                Step(0, knobs.base.type, -1, -1),
                *(Step(i, kind, 0, face) for i, (kind, face) in enumerate(cogs, start=SOURCE)),
            )
        )

    @property
    def brief(self) -> Brief:
        brief = self.tell(
            "gearing",
            BLOCKS,
            schedule=self.schedule,
            source=SOURCE,
            powered=POWERED,
            medium=MEDIUM,
            radii=tuple(library()[kind].pitch_radius for kind in BLOCKS),
            speed=constants().of("motor_speed", POWERED),
            tolerance=constants()["cog_tolerance"],
            thickness=THICKNESS,
            grid=GRID,
            hole=HOLE,
            slowest=MIN_SPEED,
            hold=HOLD,
        )
        return replace(brief, given=self.given, greatest=1.0)

    def scene(self, machine: Machine | None = None) -> Scene:  # noqa: ARG002 - always the same
        """Flat ground and wind."""
        return Scene((), self.parameters.wind.velocity)

    def referee(self, machine: Machine) -> GearingReferee:  # noqa: ARG002 - ids are given
        return GearingReferee(self.parameters.senses)

    def feedback(
        self, machine: Machine, trace: Trace, broken: tuple[Broken, ...], verdict: Verdict
    ) -> Feedback:
        """Speed of every cog, meshing pairs and locked cogs."""
        cogs = [step.id for step in machine if library()[step.type].pitch_radius is not None]
        pairs = meshing_pairs(place(machine).blocks, constants()["cog_tolerance"])
        found = gear_trains(cogs, pairs)
        locked = [sorted(train.speeds) for train in found if train.locked]
        speeds = _speeds(trace.even, cogs)
        lines = (
            f"Result: {verdict.terms['result']}",
            f"Speeds at the end, by block (rad/s, positive with the source): "
            f"{', '.join(f'{cog}: {number(speed)}' for cog, speed in speeds.items())}",
            f"Meshing: {', '.join(f'{pair.a}-{pair.b}' for pair in pairs) or 'none'}",
            f"Locked: {', '.join('-'.join(map(str, train)) for train in locked) or 'none'}",
            f"Coupled to the source: {_train_of(SOURCE, found)}",
        )
        data = {
            "speeds": {str(cog): speed for cog, speed in speeds.items()},
            "meshing": [[pair.a, pair.b] for pair in pairs],
            "locked": locked,
        }
        return compose(machine, trace, broken, verdict, "", lines, data, ())


def _speeds(trace: Trace, cogs: Sequence[int]) -> dict[int, float]:
    """Mean speed about y of each cog over the last second, rad/s, positive with the source."""
    last = trace.times >= trace.times[-1] - HOLD - 1e-9
    means = trace.angular_velocity[last][:, :, 1].mean(axis=0)
    sign = -1.0 if means[SOURCE] < 0 else 1.0
    return {cog: sign * float(means[cog]) for cog in cogs}


def _train_of(cog: int, found: Sequence[GearTrain]) -> str:
    """Ids of the other cogs in a cog's train."""
    train = next(train for train in found if cog in train.speeds)
    return ", ".join(str(other) for other in train.speeds if other != cog) or "none"
