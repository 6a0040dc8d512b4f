"""Owns the delivery family: move the cargo as far as possible along the road.

The cargo, the rule that only a cargo that the machine touches earns anything, the score and the
default feedback; roads are roads.py's, simulation is rollout.py's.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import ceil, hypot
from typing import Any, ClassVar

import numpy as np

from agentflow.env.constants import constants
from agentflow.env.feedback import compose, number, sample_indices, series
from agentflow.env.rollout import Array, Broken, Event, Feedback, Trace, Verdict
from agentflow.env.scene import Scene, Thing
from agentflow.env.tasks.base import Parameters, World
from agentflow.env.tasks.family import GROUND, CommonKnobs, Family, schedule_sentences
from agentflow.env.tasks.features.obstacles import (
    Beam,
    Cone,
    Ramp,
    beam_sentences,
    beam_things,
    ramp_sentences,
    ramp_things,
)
from agentflow.env.tasks.features.roads import (
    Curve,
    Road,
    Track,
    road_sentences,
    road_walls,
    track,
    way_of,
)
from agentflow.env.tasks.features.rough import Roughness, rough_sentences, slabs
from agentflow.env.tasks.knobs import knob
from agentflow.machine.brief import SIZE_LIMIT, Brief
from agentflow.machine.tree import Machine

BLOCKS = (0, 1, 2, 9, 15, 16, 22, 27, 35, 41, 63)
CARGO = "cargo"
PAINT = (0.83, 0.42, 0.2, 1.0)
FLIGHT = 0.2
"""Seconds off the ground after which coming down is a landing."""
ROUNDING = 1e-6
"""Seconds by which summed steps may miss a sample."""


class Cargo(Parameters):
    """The ball that is to be moved."""

    mass: float = knob(2, 0.5, 50, "kg", "mass")
    diameter: float = knob(3, 1, 5, "m", "diameter")
    at: float = knob(15, 12, 100, "m", "how far along the road from z = 0 it lies")


class DeliveryRoad(Road):
    """The road, narrower than that of movement."""

    half_width: float = knob(10, 9, 50, "m", "distance of the side walls' centres from x = 0")


class DeliveryCurve(Curve):
    """The turn, which is wider than that of movement."""

    at: float = knob(15, 10, 200, "m", "z at which it begins")
    inner_radius: float = knob(9, 1, 50, "m", "of the centre of the inner wall")


class DeliveryKnobs(CommonKnobs):
    """What can be set about a delivery level."""

    window: float = knob(10, 1, 60, "s", "length of the scored window")
    cargo: Cargo = Cargo()
    road: DeliveryRoad = DeliveryRoad()
    curve: DeliveryCurve = DeliveryCurve()
    ramp: Ramp = Ramp(at=35)
    beam: Beam = Beam()
    cone: Cone = Cone()
    terrain: Roughness = Roughness(first=20)


@dataclass(frozen=True)
class Delivery(Family):
    """Score: how far the cargo's centre gets along z+ (on a road that turns, along its centre
    line) from where it is when the machine first touches it after t = 0, m.

    What has come to rest is there where it was at t = 0; what rolls on from settling, or is blown
    along, earns nothing by that before it is touched. A cargo that is never touched scores 0.
    """

    family: ClassVar[str] = "delivery"
    knobs: ClassVar[type[CommonKnobs]] = DeliveryKnobs
    parameters: DeliveryKnobs

    @property
    def brief(self) -> Brief:
        """What designers are told and what validity checks."""
        knobs, way = self.parameters, way_of(self.parameters.curve)
        cargo, (x, z) = knobs.cargo, self._cargo_place
        return Brief(
            name=self.name,
            objective=f"Build a machine that moves the cargo as far as possible {way}.",
            scene=(
                *GROUND,
                *road_sentences(knobs.road, knobs.curve),
                f"The cargo is a ball of diameter {cargo.diameter:g} m and mass {cargo.mass:g} kg; "
                f"it lies on the road, free to roll, with its centre at x = {_rounded(x)}, y = "
                f"{cargo.diameter / 2:g}, z = {_rounded(z)} m.",
                *beam_sentences(knobs.beam),
                *ramp_sentences(knobs.ramp),
                *self._cone_sentences(),
                *rough_sentences(knobs.terrain),
                *knobs.wind.sentences(),
            ),
            schedule=schedule_sentences(self.schedule, self.window, BLOCKS),
            score=(
                f"Score: the greatest distance in metres of the cargo's centre {way} from its "
                f"place at t = 0, within {self.window:g} s.",
                "It may be pushed, pulled, carried or thrown. A cargo that the machine never "
                "touches after t = 0 scores 0, and only how far it gets from its first touch on "
                "counts.",
            ),
            blocks=BLOCKS,
            size_limit=self._size_limit,
        )

    @property
    def _size_limit(self) -> tuple[float, float, float]:
        """No machine may start within the beam."""
        x, y, z = SIZE_LIMIT
        beam = self.parameters.beam
        free = 2 * beam.at - beam.thickness if beam.clearance else z
        return x, y, min(z, free)

    def scene(self, machine: Machine | None = None) -> Scene:  # noqa: ARG002
        """The walls, the cargo, what lies across and on the road, wind."""
        knobs = self.parameters
        width = 2 * knobs.road.half_width - knobs.road.wall_thickness
        things = (
            *road_walls(knobs.road, knobs.curve),
            *slabs(knobs.terrain, width, 0),
            *beam_things(knobs.beam, width),
            *ramp_things(knobs.ramp, width),
            *self._cone(),
            _ball(knobs.cargo, *self._cargo_place),
        )
        return Scene(things, knobs.wind.velocity)

    @property
    def _cargo_place(self) -> tuple[float, float]:
        knobs = self.parameters
        return track(knobs.road, knobs.curve).place(knobs.cargo.at)

    def _cone(self) -> tuple[Thing, ...]:
        cone = self.parameters.cone
        if not cone.height:
            return ()
        x, z = self._cone_place
        size = (cone.diameter, cone.height, cone.diameter)
        return (Thing("cone", "cone", size, (x, cone.height / 2, z)),)

    @property
    def _cone_place(self) -> tuple[float, float]:
        knobs = self.parameters
        last = track(knobs.road, knobs.curve).stretches[-1]
        begin = knobs.curve.at if not knobs.curve.angle else 0.0
        x, z, _ = last.place(begin + knobs.cone.further)
        return x, z

    def _cone_sentences(self) -> tuple[str, ...]:
        cone = self.parameters.cone
        if not cone.height:
            return ()
        x, z = (_rounded(value) for value in self._cone_place)
        return (
            f"A cone of diameter {cone.diameter:g} m and height {cone.height:g} m, tip upward, "
            f"stands in the middle of the road at x = {x} m, z = {z} m.",
        )

    def referee(self, machine: Machine) -> DeliveryReferee:  # noqa: ARG002
        """A fresh observer of the cargo."""
        knobs = self.parameters
        return DeliveryReferee(track(knobs.road, knobs.curve), knobs.cargo.at)

    def feedback(
        self, machine: Machine, trace: Trace, broken: tuple[Broken, ...], verdict: Verdict
    ) -> Feedback:
        """How far the cargo got, how high, and how far it was from the machine (spec 3.2)."""
        terms = verdict.terms
        cargo = trace.thing_position[:, trace.things.index(CARGO)]
        gaps = _gaps(trace, cargo)
        index = terms["landing_index"]
        lines = (
            _touched(terms),
            f"Cargo: greatest distance {number(_term(terms, 'distance'))} m "
            f"{way_of(self.parameters.curve)} at {number(_term(terms, 'time'))} s, greatest "
            f"horizontal distance {number(_term(terms, 'reach'))} m, greatest height "
            f"{number(_term(terms, 'height'))} m, landing index "
            f"{'none' if index is None else index}",
            _gap_line(trace.times, gaps),
        )
        path = series("Cargo position", trace.times, cargo)
        data = {"gap": [float(gaps[i]) for i in sample_indices(len(gaps))]}
        return compose(machine, trace, broken, verdict, "m", lines, data, (path,))


class DeliveryReferee:
    """Follows the cargo's centre and contacts step by step."""

    def __init__(self, line: Track, at: float) -> None:
        self._line, self._at = line, at
        self._touched: float | None = None
        """When the machine first touched the cargo."""
        self._here = self._first = self._best = self._best_time = 0.0
        self._origin = (0.0, 0.0)
        self._height = self._reach = 0.0
        self._aloft: float | None = None
        """Since when the cargo has touched neither ground nor anything else of the scene."""
        self._landing: float | None = None

    def start(self, world: World) -> None:
        """Remember where the cargo rests."""
        x, _, z = world.centre(CARGO)
        self._here, self._origin = self._line.along(x, z, self._at), (x, z)
        self.watch(world)

    def watch(self, world: World) -> None:
        """Keep the greatest distance so far."""
        x, y, z = world.centre(CARGO)
        self._here = self._line.along(x, z, self._here)
        self._height = max(self._height, y)
        touching = world.touching(CARGO)
        self._fly(world.time, any(isinstance(body, str) for body in touching))
        if self._touched is None:
            if not any(isinstance(body, int) for body in touching):
                return
            self._touched, self._first = world.time, self._here
        self._reach = max(self._reach, hypot(x - self._origin[0], z - self._origin[1]))
        if self._here - self._first > self._best:
            self._best, self._best_time = self._here - self._first, world.time

    def _fly(self, time: float, down: bool) -> None:
        """Take note of the first landing."""
        if not down:
            self._aloft = time if self._aloft is None else self._aloft
            return
        if self._aloft is not None and time - self._aloft >= FLIGHT - ROUNDING:
            self._landing = time if self._landing is None else self._landing
        self._aloft = None

    def verdict(self, trace: Trace) -> Verdict:  # noqa: ARG002
        """Score, terms and events; a term is None where it does not apply."""
        touched = self._touched
        landing = self._landing
        interval = constants()["sample_interval"]
        terms: dict[str, float | bool | str | None] = {
            "distance": self._best,
            "time": self._best_time,
            "final_distance": 0.0 if touched is None else self._here - self._first,
            "touched": touched,
            "reach": self._reach,
            "height": self._height,
            "landing": landing,
            "landing_index": None if landing is None else ceil(landing / interval - ROUNDING),
        }
        return Verdict(self._best, terms, self._events())

    def _events(self) -> tuple[Event, ...]:
        events = []
        if self._touched is not None:
            text = "the machine touches the cargo for the first time"
            events.append(Event(self._touched, "cargo_touched", (), text))
        if self._landing is not None:
            text = f"the cargo comes down after {FLIGHT:g} s or more in the air"
            events.append(Event(self._landing, "landing", (), text))
        return tuple(events)


def _rounded(value: float) -> str:
    return f"{round(value, 1) + 0.0:g}"


def _ball(cargo: Cargo, x: float, z: float) -> Thing:
    size = (cargo.diameter, cargo.diameter, cargo.diameter)
    place = (x, cargo.diameter / 2, z)
    return Thing(CARGO, "sphere", size, place, mass=cargo.mass, color=PAINT)


def _touched(terms: Mapping[str, Any]) -> str:
    if terms["touched"] is None:
        return "Result: the machine never touched the cargo"
    return f"Result: the machine first touched the cargo at {number(terms['touched'])} s"


def _term(terms: Mapping[str, Any], name: str) -> float:
    return float(terms[name] or 0.0)


def _gaps(trace: Trace, cargo: Array) -> Array:
    """(T,) metres from the cargo's centre (T, 3) to that of the nearest block."""
    away = np.linalg.norm(trace.centre - cargo[:, None], axis=2)
    gaps: Array = away.min(axis=1)
    return gaps


def _gap_line(times: Array, gaps: Array) -> str:
    picks = sample_indices(len(gaps))
    step = float(times[picks[1]]) if len(picks) > 1 else 0.0
    shown = " ".join(number(gaps[i], 1) for i in picks)
    return f"Distance from the cargo's centre to the nearest block every {step:.3g} s (m): {shown}"
