"""The movement family: drive the root block as far as possible along the road."""

from __future__ import annotations

import random
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from pydantic import model_validator

from agentflow.env.feedback.compose import compose
from agentflow.env.feedback.text import series, term_number
from agentflow.env.rollout import Array, Broken, Feedback, Trace, Verdict
from agentflow.env.scene import Scene, SceneObject
from agentflow.env.tasks.balancing import FIRST, LASTS, WHEEL, Balance, BalanceReferee, axle_problem
from agentflow.env.tasks.base import ON_WHEELS, Descriptor, Parameters, Referee, WorldView
from agentflow.env.tasks.family import TRIALS, CommonKnobs, Family
from agentflow.env.tasks.features import roads
from agentflow.env.tasks.features.terrain import SLAB, Ramp, Roughness, Stones, bump
from agentflow.env.tasks.knobs import knob
from agentflow.env.tasks.stopping import REST, TOLERANCE, Stop, StopReferee
from agentflow.machine.brief import Brief
from agentflow.machine.tree import Machine

ROOT_BLOCK = 0
BLOCKS = (0, 1, 2, 9, 15, 16, 22, 35, 41, 63)
CURVE_BLOCKS = (19, 40)
"""Additional blocks for roads that turn."""


class Bumps(Parameters):
    """Rounded bumps across the road."""

    count: int = knob(0, 0, 20, "", "number of bumps")
    first: float = knob(15, 10, 200, "m", "z of the first bump's middle")
    spacing: float = knob(15, 5, 100, "m", "distance between bumps")
    height: float = knob(1, 0.1, 3, "m", "height of the bumps")
    length: float = knob(4, 1, 20, "m", "length of the bumps along z")

    @property
    def places(self) -> tuple[float, ...]:
        """z of each bump's middle, m."""
        return tuple(self.first + index * self.spacing for index in range(self.count))


class MovementKnobs(CommonKnobs):
    """Knobs of a movement level."""

    road: roads.Road = roads.Road()
    curve: roads.Curve = roads.Curve()
    bump: Bumps = Bumps()
    ramp: Ramp = Ramp()
    roughness: Roughness = Roughness()
    obstacles: Stones = Stones()
    stop: Stop = Stop()
    balance: Balance = Balance()

    @model_validator(mode="after")
    def _one_aim(self) -> MovementKnobs:
        if self.stop.gap and self.balance.height:
            raise ValueError("stop.gap and balance.height exclude each other: set one of them to 0")
        if self.balance.height and self.balance.until + LASTS > self.window:
            raise ValueError(
                f"a gust may blow until {self.balance.until + LASTS:g} s, when the window of "
                f"{self.window:g} s has ended: lower balance.until, or raise window"
            )
        return self

    @property
    def trials(self) -> int:
        return TRIALS if self.stop.gap or self.balance.height else 1


@dataclass(frozen=True)
class Movement(Family):
    """Score: greatest distance of the root block's centre along z+ (along the centre line of a
    road that turns) from its position at t = 0, m; with a wall ahead or a balance to keep, the
    number of trials out of ten in which the machine stops before it, or keeps it."""

    family: ClassVar[str] = "movement"
    knobs: ClassVar[type[CommonKnobs]] = MovementKnobs
    drives: ClassVar[bool] = True
    symmetric: ClassVar[bool] = True
    performance: ClassVar[str] = "distance"
    ranked: ClassVar[bool] = True
    diagnosed: ClassVar[bool] = True
    descriptors: ClassVar[tuple[Descriptor, ...]] = ON_WHEELS
    parameters: MovementKnobs
    wall: float = 0.0
    """z of the near face of the wall in this trial, m."""

    def draw(self, rng: random.Random) -> dict[str, Any]:
        """Where the wall stands, or the gust."""
        knobs = self.parameters
        if not knobs.balance.height:
            return {"wall": knobs.stop.draw(rng)}
        at, speed = knobs.balance.draw(rng)
        wind = knobs.wind.model_copy(update={"speed": speed})
        return {
            "parameters": knobs.model_copy(update={"wind": wind}),
            "schedule": replace(self.schedule, more=knobs.balance.switches(at)),
        }

    @property
    def _wall(self) -> float:
        """z of the near face of the wall, m."""
        return self.wall if self.trial else self.parameters.stop.middle

    @property
    def unit(self) -> str:
        """As in `Task`."""
        return "m" if self.parameters.trials == 1 else ""

    @property
    def brief(self) -> Brief:
        knobs = self.parameters
        brief = self.tell(
            "movement",
            BLOCKS + CURVE_BLOCKS if knobs.curve.angle else BLOCKS,
            **roads.told(knobs.road, knobs.curve),
            slab=SLAB,
            tolerance=TOLERANCE,
            rest=REST,
            earliest=FIRST,
            lasts=LASTS,
        )
        needed = {WHEEL: 2} if knobs.balance.height else {}
        greatest = float(TRIALS) if knobs.trials > 1 else None
        return replace(brief, required=needed, greatest=greatest)

    def scene(self, machine: Machine | None = None) -> Scene:  # noqa: ARG002
        """Walls, obstacles and wind."""
        knobs, width = self.parameters, self.parameters.road.inner_width
        objects = (
            *roads.road_walls(knobs.road, knobs.curve),
            *_bumps(knobs.bump, width),
            *knobs.ramp.objects(width),
            *knobs.roughness.objects(width, knobs.obstacles.seed),
            *knobs.obstacles.objects(width),
            *knobs.stop.objects(self._wall, width),
        )
        target = (0.0, 0.0, self._wall if knobs.stop.gap else 0.0)
        held = bool(knobs.balance.height)
        return Scene(objects, knobs.wind.velocity, target=target, machine_held=held)

    def fault(self, machine: Machine) -> str:
        """What is wrong with the wheels of a machine that must stay upright on them."""
        return axle_problem(machine) if self.parameters.balance.height else ""

    def referee(self, machine: Machine) -> Referee:
        if self.parameters.balance.height:
            around = tuple(item.name for item in self.scene().objects)
            return BalanceReferee(machine, self.parameters.balance, around)
        if self.parameters.stop.gap:
            return StopReferee(machine, self.parameters.stop, self._wall)
        return MovementReferee(roads.centre_line(self.parameters.road, self.parameters.curve))

    def feedback(
        self, machine: Machine, trace: Trace, broken: tuple[Broken, ...], verdict: Verdict
    ) -> Feedback:
        """Distance, speeds and path of the root."""
        even = trace.even
        speed = np.linalg.norm(even.velocity[:, ROOT_BLOCK], axis=1)
        means = _mean_per_second(even.times, speed)
        path = series("Root position", even.times, even.centre[:, ROOT_BLOCK])
        data = {"greatest_speed": float(speed.max()), "mean_speed_per_second": means}
        told = "Mean speed in each second (m/s): " + ", ".join(f"{mean:.2f}" for mean in means)
        if self.parameters.trials > 1:
            result = f"Result: {verdict.terms['outcome']}"
            if not self.parameters.balance.height:
                result += f"; its near face is at z = {self._wall:g} m"
        else:
            result = (
                f"Root: greatest distance {term_number(verdict.terms, 'distance'):.2f} m "
                f"{roads.scoring_direction(self.parameters.curve)} at "
                f"{verdict.terms['time']:.2f} s, greatest speed {speed.max():.2f} m/s, ends at x = "
                f"{trace.centre[-1, ROOT_BLOCK, 0]:.2f} m"
            )
        return compose(machine, trace, broken, verdict, self.unit, (result, told), data, (path,))


class MovementReferee:
    """Tracks the root's centre step by step."""

    def __init__(self, line: roads.CentreLine) -> None:
        self._line = line
        self._start = self._here = self._best = self._best_time = 0.0

    def start(self, world: WorldView) -> None:
        """Record where the root rests."""
        x, _, z = world.centre(ROOT_BLOCK)
        self._start = self._here = self._line.distance_along(x, z, z)

    def watch(self, world: WorldView) -> None:
        """Update the greatest distance."""
        x, _, z = world.centre(ROOT_BLOCK)
        self._here = self._line.distance_along(x, z, self._here)
        distance = self._here - self._start
        if distance > self._best:
            self._best, self._best_time = distance, world.time

    def verdict(self, trace: Trace) -> Verdict:
        """Score and terms: distance (m), its time (s), final sideways drift (m)."""
        drift = float(trace.centre[-1, ROOT_BLOCK, 0] - trace.centre[0, ROOT_BLOCK, 0])
        terms = {
            "distance": self._best,
            "time": self._best_time,
            "final_distance": self._here - self._start,
            "drift": drift,
        }
        return Verdict(self._best, terms)


def _bumps(bumps: Bumps, width: float) -> Iterator[SceneObject]:
    for index, z in enumerate(bumps.places, start=1):
        yield bump(f"bump {index}", z, bumps.height, bumps.length, width)


def _mean_per_second(times: Array, speed: Array) -> list[float]:
    """Mean of the sampled speeds in each second of the rollout; `times` and `speed` are (T,)."""
    last = max(1, int(np.ceil(times[-1] - 1e-9)))
    picks = [(times >= second - 1e-9) & (times <= second + 1 + 1e-9) for second in range(last)]
    return [float(speed[pick].mean()) for pick in picks]
