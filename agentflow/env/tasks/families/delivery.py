"""The delivery family: move a cargo ball as far as possible along the road."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import hypot
from typing import ClassVar

import numpy as np

from agentflow.env.constants import constants
from agentflow.env.feedback.compose import compose
from agentflow.env.feedback.text import number, sample_indices, series, term_number
from agentflow.env.rollout import Broken, Feedback, Moment, RolloutEvent, Trace, Verdict
from agentflow.env.scene import Scene, SceneObject, blocks_among, objects_among
from agentflow.env.tasks.base import ROUNDING, Parameters, WorldView
from agentflow.env.tasks.family import CommonKnobs, Family
from agentflow.env.tasks.features import roads
from agentflow.env.tasks.features.terrain import SLAB, Beam, Cone, Ramp, Roughness
from agentflow.env.tasks.knobs import knob
from agentflow.machine.brief import SIZE_LIMIT, Brief, Limits
from agentflow.machine.tree import Machine

BLOCKS = (0, 1, 2, 9, 15, 16, 22, 27, 35, 41, 63)
CARGO = "cargo"
COLOR = (0.83, 0.42, 0.2, 1.0)
FLIGHT = 0.2
"""Shortest time in the air before a landing, s."""


class Cargo(Parameters):
    """The ball to move."""

    mass: float = knob(2, 0.5, 50, "kg", "mass")
    diameter: float = knob(3, 1, 5, "m", "diameter")
    at: float = knob(15, 12, 100, "m", "distance along the road from z = 0")


class DeliveryRoad(roads.Road):
    """The road; narrower than in movement."""

    half_width: float = knob(10, 9, 50, "m", "distance of the side walls' centres from x = 0")


class DeliveryCurve(roads.Curve):
    """The turns; wider than in movement."""

    at: float = knob(15, 10, 200, "m", "z where the first turn starts")
    inner_radius: float = knob(9, 1, 50, "m", "radius of the inner wall's centre line")


class DeliveryKnobs(CommonKnobs):
    """Knobs of a delivery level."""

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
    """Score: greatest distance of the cargo's centre along z+ (along the centre line of a road
    that turns) from where the machine first touches it after t = 0, m.

    Motion before that touch, by wind or left over from settling, scores nothing. A cargo that is
    never touched scores 0.
    """

    family: ClassVar[str] = "delivery"
    unit = "m"
    knobs: ClassVar[type[CommonKnobs]] = DeliveryKnobs
    drives: ClassVar[bool] = True
    ranked: ClassVar[bool] = True
    parameters: DeliveryKnobs

    @property
    def limits(self) -> Limits:
        """Shorter machines where one would start inside the beam."""
        (x, y, z), beam = SIZE_LIMIT, self.parameters.beam
        free = 2 * beam.at - beam.thickness if beam.clearance else z
        return replace(super().limits, size=(x, y, min(z, free)))

    @property
    def brief(self) -> Brief:
        knobs = self.parameters
        return self.tell(
            "delivery",
            BLOCKS,
            **roads.told(knobs.road, knobs.curve),
            friction=constants()["friction"],
            slab=SLAB,
            cargo_at=self._cargo_place,
            cone_at=self._cone_place,
        )

    def scene(self, machine: Machine | None = None) -> Scene:  # noqa: ARG002
        """Walls, obstacles, cargo and wind."""
        knobs, width = self.parameters, self.parameters.road.inner_width
        mass, wide, (x, z) = knobs.cargo.mass, knobs.cargo.diameter, self._cargo_place
        objects = (
            *roads.road_walls(knobs.road, knobs.curve),
            *knobs.terrain.objects(width, 0),
            *knobs.beam.objects(width),
            *knobs.ramp.objects(width),
            *self._cone(),
            SceneObject(CARGO, "sphere", (wide,) * 3, (x, wide / 2, z), mass=mass, color=COLOR),
        )
        return Scene(objects, knobs.wind.velocity)

    @property
    def _cargo_place(self) -> tuple[float, float]:
        knobs = self.parameters
        return roads.centre_line(knobs.road, knobs.curve).position_at(knobs.cargo.at)

    def _cone(self) -> Iterator[SceneObject]:
        cone = self.parameters.cone
        if cone.height:
            x, z = self._cone_place
            size = (cone.diameter, cone.height, cone.diameter)
            yield SceneObject("cone", "cone", size, (x, cone.height / 2, z))

    @property
    def _cone_place(self) -> tuple[float, float]:
        knobs = self.parameters
        last = roads.centre_line(knobs.road, knobs.curve).segments[-1]
        begin = knobs.curve.at if not knobs.curve.angle else 0.0
        return last.position_at(begin + knobs.cone.further)[:2]

    def referee(self, machine: Machine) -> DeliveryReferee:  # noqa: ARG002
        knobs = self.parameters
        return DeliveryReferee(roads.centre_line(knobs.road, knobs.curve), knobs.cargo.at)

    def feedback(
        self, machine: Machine, trace: Trace, broken: tuple[Broken, ...], verdict: Verdict
    ) -> Feedback:
        """Distance and height of the cargo, and its distance from the machine."""
        terms, even = verdict.terms, trace.even
        cargo = even.object_position[:, trace.objects.index(CARGO)]
        gaps = np.linalg.norm(even.centre - cargo[:, None], axis=2).min(axis=1)
        touched, landing = terms["touched"], terms["landing"]
        picks = sample_indices(len(gaps))
        step = float(even.times[picks[1]]) if len(picks) > 1 else 0.0
        distance, time, reach, height = (
            number(term_number(terms, name)) for name in ("distance", "time", "reach", "height")
        )
        lines = (
            "Result: the machine never touched the cargo"
            if touched is None
            else f"Result: the machine first touched the cargo at {number(float(touched))} s",
            f"Cargo: greatest distance {distance} m "
            f"{roads.scoring_direction(self.parameters.curve)} at {time} s, "
            f"greatest horizontal distance {reach} m, greatest height {height} m, "
            + (
                "no landing after free flight"
                if landing is None
                else f"landed at {number(float(landing))} s"
            ),
            f"Distance from the cargo's centre to the nearest block every {step:.3g} s (m): "
            + " ".join(number(gaps[i], 1) for i in picks),
        )
        path = series("Cargo position", even.times, cargo)
        data = {"gap": [float(gaps[i]) for i in picks]}
        return compose(machine, trace, broken, verdict, self.unit, lines, data, (path,))


class DeliveryReferee:
    """Tracks the cargo's centre and contacts step by step."""

    def __init__(self, line: roads.CentreLine, at: float) -> None:
        self._line, self._at = line, at
        self._touched: float | None = None
        """Time at which the machine first touched the cargo, s."""
        self._here = self._first = self._best = self._best_time = 0.0
        self._origin = (0.0, 0.0)
        self._height = self._reach = 0.0
        self._aloft: float | None = None
        """Time since which the cargo has touched neither the ground nor a scene object, s."""
        self._landing: float | None = None

    def start(self, world: WorldView) -> None:
        """Record where the cargo rests."""
        x, _, z = world.centre(CARGO)
        self._here, self._origin = self._line.distance_along(x, z, self._at), (x, z)
        self.watch(world)

    def watch(self, world: WorldView) -> None:
        """Update the greatest distance."""
        x, y, z = world.centre(CARGO)
        self._here = self._line.distance_along(x, z, self._here)
        self._height = max(self._height, y)
        touching = world.touching(CARGO)
        self._note_landing(world.time, bool(objects_among(touching)))
        if self._touched is None:
            if not blocks_among(touching):
                return
            self._touched, self._first = world.time, self._here
        self._reach = max(self._reach, hypot(x - self._origin[0], z - self._origin[1]))
        if self._here - self._first > self._best:
            self._best, self._best_time = self._here - self._first, world.time

    def _note_landing(self, time: float, down: bool) -> None:
        """Record the first landing."""
        if not down:
            self._aloft = time if self._aloft is None else self._aloft
            return
        flew = self._aloft is not None and time - self._aloft >= FLIGHT - ROUNDING
        if flew and self._landing is None:
            self._landing = time
        self._aloft = None

    def verdict(self, trace: Trace) -> Verdict:
        """Score, terms and events; terms that do not apply are None."""
        terms: dict[str, float | bool | str | None] = {
            "distance": self._best,
            "time": self._best_time,
            "final_distance": 0.0 if self._touched is None else self._here - self._first,
            "touched": self._touched,
            "reach": self._reach,
            "height": self._height,
            "landing": self._landing,
        }
        return Verdict(self._best, terms, self._events(), self._fastest(trace))

    def _fastest(self, trace: Trace) -> Moment | None:
        """When the cargo was fastest: it is pushed until then, and rolls on by itself."""
        if self._touched is None:
            return None
        speed = np.linalg.norm(trace.object_velocity[:, trace.objects.index(CARGO)], axis=1)
        return Moment(float(trace.times[int(speed.argmax())]), "the cargo's top speed", CARGO)

    def _events(self) -> tuple[RolloutEvent, ...]:
        events = []
        if self._touched is not None:
            text = "the machine touches the cargo for the first time"
            events.append(RolloutEvent(self._touched, "cargo_touched", (), text))
        if self._landing is not None:
            text = f"the cargo lands after {FLIGHT:g} s or more in the air"
            events.append(RolloutEvent(self._landing, "landing", (), text))
        return tuple(events)
