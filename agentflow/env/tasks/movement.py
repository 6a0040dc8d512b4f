"""Owns the movement family: drive the root block as far as possible along z+.

The road, its walls and obstacles, the score and the default feedback; simulation is rollout.py's.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from agentflow.env.feedback import compose, series
from agentflow.env.scene import Scene, Thing, Vec3
from agentflow.env.tasks.base import Parameters, World
from agentflow.env.tasks.family import GROUND, CommonKnobs, Family, schedule_sentences, wall
from agentflow.env.tasks.knobs import knob
from agentflow.env.tasks.obstacles import bump, quarter_pipe
from agentflow.env.trace import Array, Broken, Feedback, Trace, Verdict
from agentflow.machine.brief import Brief
from agentflow.machine.tree import Machine

ROOT_BLOCK = 0
BLOCKS = (0, 1, 2, 9, 15, 16, 22, 35, 41, 63)


class Road(Parameters):
    """The straight road between its walls."""

    half_width: float = knob(12, 9, 50, "m", "distance of the side walls' centres from x = 0")
    wall_height: float = knob(5, 0.5, 20, "m", "height of the walls")
    wall_thickness: float = knob(1, 0.2, 2, "m", "thickness of the walls")
    wall_friction: float = knob(0, 0, 2, "", "friction coefficient of the walls")
    back: float = knob(16, 10, 50, "m", "distance of the rear wall's centre behind z = 0")
    length: float = knob(250, 50, 1000, "m", "how far the side walls reach along z+")


class Bumps(Parameters):
    """Segments of cylinders across the road."""

    count: int = knob(0, 0, 20, "", "how many bumps there are")
    first: float = knob(15, 10, 200, "m", "z of the first bump's middle")
    spacing: float = knob(15, 5, 100, "m", "from one bump to the next")
    height: float = knob(1, 0.1, 3, "m", "height of a bump")
    length: float = knob(4, 1, 20, "m", "length of a bump along z")


class Ramp(Parameters):
    """A quarter-pipe across the road, open behind."""

    height: float = knob(0, 0, 6, "m", "height of its upper edge; 0 removes it")
    length: float = knob(6.6, 2, 20, "m", "length along z")
    at: float = knob(19, 10, 200, "m", "z of its middle")


class MovementKnobs(CommonKnobs):
    """What can be set about a movement level."""

    road: Road = Road()
    bump: Bumps = Bumps()
    ramp: Ramp = Ramp()


@dataclass(frozen=True)
class Movement(Family):
    """Score: greatest distance of the root block's centre along z+ from its place at t = 0, m."""

    family: ClassVar[str] = "movement"
    knobs: ClassVar[type[CommonKnobs]] = MovementKnobs
    parameters: MovementKnobs

    @property
    def brief(self) -> Brief:
        """What designers are told and what validity checks."""
        knobs = self.parameters
        road = knobs.road
        return Brief(
            name=self.name,
            objective="Build a machine that drives its Starting Block as far as possible along z+.",
            scene=(
                *GROUND,
                f"A road runs along z+ between walls at x = -{road.half_width:g} m and x = "
                f"{road.half_width:g} m, {road.wall_height:g} m high, {road.length:g} m long, of "
                f"friction {road.wall_friction:g}; a wall closes it behind the machine at z = "
                f"-{road.back:g} m.",
                *_bump_sentences(knobs.bump),
                *_ramp_sentences(knobs.ramp),
                *knobs.wind.sentences(),
            ),
            schedule=schedule_sentences(self.schedule, self.window),
            score=(
                f"Score: the greatest distance in metres of the Starting Block's centre along z+ "
                f"from its place at t = 0, within {self.window:g} s.",
                "Sideways, backward and upward motion count nothing; what moves before t = 0 "
                "counts nothing.",
            ),
            blocks=BLOCKS,
        )

    def scene(self, machine: Machine | None = None) -> Scene:  # noqa: ARG002
        """Two side walls, a rear wall, what lies across the road, wind."""
        knobs = self.parameters
        width = 2 * knobs.road.half_width - knobs.road.wall_thickness
        across = (*_bumps(knobs.bump, width), *_ramp(knobs.ramp, width))
        return Scene((*_road_walls(knobs.road), *across), knobs.wind.velocity)

    def referee(self, machine: Machine) -> MovementReferee:  # noqa: ARG002 - the root is block 0
        """A fresh observer of the root."""
        return MovementReferee()

    def feedback(
        self, machine: Machine, trace: Trace, broken: tuple[Broken, ...], verdict: Verdict
    ) -> Feedback:
        """Distance, speeds and the root's path (spec 3.2)."""
        speed = np.linalg.norm(trace.velocity[:, ROOT_BLOCK], axis=1)
        means = _mean_per_second(trace.times, speed)
        distance = float(verdict.terms["distance"] or 0.0)
        lines = (
            f"Root: greatest distance {distance:.2f} m along z+ at {verdict.terms['time']:.2f} s, "
            f"greatest speed {speed.max():.2f} m/s, ends at x = "
            f"{trace.centre[-1, ROOT_BLOCK, 0]:.2f} m",
            "Mean speed in each second (m/s): " + ", ".join(f"{mean:.2f}" for mean in means),
        )
        data = {"greatest_speed": float(speed.max()), "mean_speed_per_second": means}
        path = series("Root position", trace.times, trace.centre[:, ROOT_BLOCK])
        return compose(machine, trace, broken, verdict, "m", lines, data, (path,))


class MovementReferee:
    """Follows the root's centre step by step."""

    def __init__(self) -> None:
        self._start = 0.0
        self._best = 0.0
        self._best_time = 0.0

    def start(self, world: World) -> None:
        """Remember where the root rests."""
        self._start = world.centre(ROOT_BLOCK)[2]

    def watch(self, world: World) -> None:
        """Keep the greatest distance so far."""
        distance = world.centre(ROOT_BLOCK)[2] - self._start
        if distance > self._best:
            self._best, self._best_time = distance, world.time

    def verdict(self, trace: Trace) -> Verdict:
        """Score and terms: distance (m), its time (s), the sideways drift at the end (m)."""
        drift = float(trace.centre[-1, ROOT_BLOCK, 0] - trace.centre[0, ROOT_BLOCK, 0])
        final = float(trace.centre[-1, ROOT_BLOCK, 2]) - self._start
        terms = {
            "distance": self._best,
            "time": self._best_time,
            "final_distance": final,
            "drift": drift,
        }
        return Verdict(self._best, terms)


def _road_walls(road: Road) -> tuple[Thing, ...]:
    span = road.length + road.back
    side: Vec3 = (road.wall_thickness, road.wall_height, span)
    rear: Vec3 = (2 * road.half_width - road.wall_thickness, road.wall_height, road.wall_thickness)
    middle = road.length / 2 - road.back / 2
    return (
        wall("wall left", -road.half_width, middle, side, road.wall_friction),
        wall("wall right", road.half_width, middle, side, road.wall_friction),
        wall("wall back", 0.0, -road.back, rear, road.wall_friction),
    )


def _bumps(bumps: Bumps, width: float) -> Iterator[Thing]:
    for index, z in enumerate(_bump_places(bumps), start=1):
        yield bump(f"bump {index}", z, bumps.height, bumps.length, width)


def _bump_places(bumps: Bumps) -> list[float]:
    return [bumps.first + index * bumps.spacing for index in range(bumps.count)]


def _bump_sentences(bumps: Bumps) -> tuple[str, ...]:
    return tuple(
        f"A rounded bump lies across the whole road with its middle at z = {z:g} m: "
        f"{bumps.height:g} m high, {bumps.length:g} m long."
        for z in _bump_places(bumps)
    )


def _ramp(ramp: Ramp, width: float) -> Iterator[Thing]:
    if ramp.height:
        yield from quarter_pipe("ramp", ramp.at, ramp.height, ramp.length, width)


def _ramp_sentences(ramp: Ramp) -> tuple[str, ...]:
    if not ramp.height:
        return ()
    start, end = ramp.at - ramp.length / 2, ramp.at + ramp.length / 2
    return (
        f"A quarter-pipe lies across the whole road: flat at z = {start:g} m, it steepens to its "
        f"edge at z = {end:g} m, {ramp.height:g} m high; behind the edge it drops to the ground.",
    )


def _mean_per_second(times: Array, speed: Array) -> list[float]:
    """Mean of the sampled speeds within each started second; both (T,)."""
    last = max(1, int(np.ceil(times[-1] - 1e-9)))
    picks = [(times >= second - 1e-9) & (times <= second + 1 + 1e-9) for second in range(last)]
    return [float(speed[pick].mean()) for pick in picks]
