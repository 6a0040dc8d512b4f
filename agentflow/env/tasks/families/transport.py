"""The transport family: drive, or carry a cargo, to a target that is off the straight line."""

from __future__ import annotations

import random
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from pydantic import model_validator

from agentflow.env.feedback.compose import compose
from agentflow.env.feedback.text import number, object_label, series, steering_angles, term_number
from agentflow.env.rollout import Array, Broken, Feedback, Moment, RolloutEvent, Trace, Verdict
from agentflow.env.scene import Body, Scene, SceneObject, objects_among
from agentflow.env.tasks.base import ON_WHEELS, Descriptor, Parameters, WorldView
from agentflow.env.tasks.family import TRIALS, CommonKnobs, Family, wall
from agentflow.env.tasks.features.journey import LEAST, Journey, Target, target_mark
from agentflow.env.tasks.features.resting import highest_point_under, start_of_root
from agentflow.env.tasks.features.terrain import SLAB, Roughness
from agentflow.env.tasks.knobs import knob
from agentflow.machine.blocks.library import BRACE
from agentflow.machine.brief import SIZE_LIMIT, Brief, Limits
from agentflow.machine.tree import Machine

BLOCKS = (0, 1, 2, 5, 7, 13, 15, 16, 22, 28, 35, 40, 46, 50, 63)
CARGO, ROOT_BLOCK = "cargo", 0
POINTS = 10.0
"""For coming close to the target, minus the distance in metres; as many more for arriving."""
THICK = 0.5
"""Thickness of the wall, m."""
WIDE = 48.0
"""Extent of uneven ground along x, m."""
FIRST = 1.0
"""Earliest moment at which the cargo of a trial falls, s."""
COLOR = (0.75, 0.35, 0.2, 1.0)


class Cargo(Parameters):
    """The box to carry."""

    mass: float = knob(0, 0, 500, "kg", "mass; 0 removes the cargo")
    width: float = knob(2.5, 0.5, 8, "m", "size along x")
    length: float = knob(2.5, 0.5, 8, "m", "size along z")
    height: float = knob(1.5, 0.5, 5, "m", "height")
    drop: float = knob(3.5, 0, 9, "m", "height above the ground from which it falls")
    falls: float = knob(
        0, 0, 30, "s", "latest moment at which it falls, drawn for ten trials; 0: before t = 0"
    )
    within: float = knob(6, 1, 30, "s", "time after the fall at which such a trial ends")

    @model_validator(mode="after")
    def _falls_late_enough(self) -> Cargo:
        if 0.0 < self.falls < FIRST:
            raise ValueError(f"falls must be 0 or at least {FIRST:g}: no cargo falls earlier")
        return self


class Wall(Parameters):
    """A wall along x, between start and target."""

    height: float = knob(0, 0, 5, "m", "height; 0 removes it")
    left: float = knob(4, -10, 20, "m", "x of its left end")
    length: float = knob(5, 1, 20, "m", "length along x")
    ahead: float = knob(5, 5, 20, "m", "z of its middle")


class UnevenGround(Roughness):
    """Random height of the ground ahead."""

    first: float = knob(6, 5, 100, "m", "z where uneven ground begins")
    last: float = knob(24, 8, 100, "m", "z where uneven ground ends")


class TransportKnobs(CommonKnobs):
    """Knobs of a transport level."""

    window: float = knob(10, 1, 60, "s", "length of the scored window")
    target: Target = Target()
    cargo: Cargo = Cargo()
    wall: Wall = Wall()
    ground: UnevenGround = UnevenGround()

    @model_validator(mode="after")
    def _falls_in_the_window(self) -> TransportKnobs:
        if self.cargo.mass and self.cargo.falls >= self.window:
            raise ValueError(
                f"the cargo may fall at {self.cargo.falls:g} s, when the window of "
                f"{self.window:g} s has ended: lower cargo.falls, or raise window"
            )
        return self

    @property
    def trials(self) -> int:
        return TRIALS if self.cargo.mass and self.cargo.falls else 1


@dataclass(frozen=True)
class Transport(Family):
    """Score: 10 minus the final distance in metres from the target of what is to be moved (the
    cargo, else the root block), and 10 more if it arrived and nothing broke.

    The distance freezes when the cargo first touches anything but the machine. On a way there and
    back, half of the distance left counts. A part of the way on which some block stayed where it
    was does not count, so that arms and catapults earn nothing. If the cargo falls at a moment that
    is not told: the number of trials out of ten in which it arrives.
    """

    family: ClassVar[str] = "transport"
    knobs: ClassVar[type[CommonKnobs]] = TransportKnobs
    descriptors: ClassVar[tuple[Descriptor, ...]] = ON_WHEELS
    parameters: TransportKnobs

    def draw(self, rng: random.Random) -> dict[str, Any]:
        """When the cargo falls."""
        cargo = self.parameters.cargo
        moment = round(rng.uniform(FIRST, cargo.falls), 2)
        return {
            "window": min(self.window, round(moment + cargo.within, 2)),
            "schedule": replace(self.schedule, more=((moment, "holds", 1.0),)),
        }

    @property
    def limits(self) -> Limits:
        """Shorter machines where one would start in the wall or on uneven ground.

        A program may be as long as the whole task, even in trials that end earlier.
        """
        knobs, (x, y, z) = self.parameters, SIZE_LIMIT
        if knobs.wall.height:
            z = min(z, 2 * knobs.wall.ahead - THICK)
        if knobs.ground.height:
            z = min(z, 2 * knobs.ground.first)
        limits = super().limits
        longest = None if limits.controls is None else knobs.window
        return replace(limits, size=(x, y, z), controls=longest)

    @property
    def brief(self) -> Brief:
        brief = self.tell(
            "transport",
            BLOCKS,
            brace=BRACE in self.allow(BLOCKS),
            earliest=FIRST,
            thick=THICK,
            least=LEAST,
            slab=SLAB,
        )
        return replace(brief, greatest=float(TRIALS) if self.parameters.trials > 1 else 2 * POINTS)

    def scene(self, machine: Machine | None = None) -> Scene:
        """Cargo, above the machine if there is one, wall, uneven ground, target and wind."""
        knobs = self.parameters
        objects = (
            *_cargo_objects(knobs.cargo, machine),
            *_wall_objects(knobs.wall),
            *knobs.ground.objects(WIDE, 0),
            target_mark(knobs.target),
        )
        x, z = (0.0, 0.0) if knobs.cargo.mass or machine is None else start_of_root(machine)
        target = (x + knobs.target.right, 0.0, z + knobs.target.ahead)
        return Scene(objects, knobs.wind.velocity, target=target)

    def referee(self, machine: Machine) -> TransportReferee:  # noqa: ARG002 - blocks are traced
        return TransportReferee(self.parameters)

    def feedback(
        self, machine: Machine, trace: Trace, broken: tuple[Broken, ...], verdict: Verdict
    ) -> Feedback:
        """How far it came, how straight, how it steered, and its path."""
        even, cargo = trace.even, bool(self.parameters.cargo.mass)
        centres = even.object_position[:, 0] if cargo else even.centre[:, ROOT_BLOCK]
        lines = (
            f"Result: {verdict.terms['result']}",
            f"Way: greatest deviation {number(term_number(verdict.terms, 'deviation'))} m from the "
            f"straight line, greatest speed {number(_top_speed(even.times, centres))} m/s",
        )
        path = series("Cargo position" if cargo else "Root position", even.times, centres)
        paths = (*steering_angles(machine, even), path)
        return compose(machine, trace, broken, verdict, "", lines, {}, paths)


class TransportReferee:
    """Follows what is to be moved on its way, until the cargo is lost."""

    def __init__(self, knobs: TransportKnobs) -> None:
        self._journey = Journey(knobs.target)
        self._cargo, self._trials = bool(knobs.cargo.mass), knobs.trials
        self._body: Body = CARGO if self._cargo else ROOT_BLOCK
        self._lost: tuple[float, str] | None = None
        """When (s) the cargo first touched something else, and what."""

    def start(self, world: WorldView) -> None:
        """Record where it rests."""
        x, _, z = world.centre(self._body)
        self._journey.start((x, z))

    def watch(self, world: WorldView) -> None:
        """Follow the journey until the cargo is lost."""
        if self._lost is not None or (self._cargo and not self._carried(world)):
            return
        x, _, z = world.centre(self._body)
        self._journey.move((x, z), world.time)

    def _carried(self, world: WorldView) -> bool:
        """Whether the cargo is on the machine; notes what else it touches."""
        touching = world.touching(CARGO)
        others = objects_among(touching)
        if others:
            self._lost = world.time, others[0]
        return bool(touching) and not others

    def verdict(self, trace: Trace) -> Verdict:
        """Score and terms: distance and deviation (m), arrival, intactness, times (s)."""
        journey = self._journey
        distance, stayed = journey.distance(trace)
        success = journey.arrived is not None and not stayed and self._lost is None
        intact = bool(trace.alive[-1].all()) and not np.isnan(trace.utilisation[-1]).any()
        score = max(0.0, POINTS - distance) + (POINTS if success and intact else 0.0)
        result = self._result(success, stayed, intact)
        terms: dict[str, float | bool | str | None] = {
            "distance": distance,
            "success": success,
            "intact": intact,
            "deviation": journey.deviation,
            "time": journey.arrived if success else None,
            "turned": journey.turned,
            "lost_at": None if self._lost is None else self._lost[0],
            "result": result,
        }
        if self._trials > 1:
            success = success and intact
            score = float(success)
            miss = None if success else max(0.0, distance - journey.target.reach) or None
            terms |= {"success": success, "outcome": result, "miss": miss}
        moment = None if self._lost is None else Moment(self._lost[0], "the cargo's loss", CARGO)
        return Verdict(score, terms, tuple(self._events()), moment)

    def _result(self, success: bool, stayed: bool, intact: bool) -> str:
        journey = self._journey
        end = "start" if journey.turned is not None else "target"
        away = f"{number(journey.left)} m from the {end}"
        if success:
            state = "intact" if intact else "but something broke"
            since = number(float(journey.arrived or 0.0))
            near = f"within {number(journey.target.reach)} m since {since} s"
            return f"arrived: {near}, {away} at the end, {state}"
        if self._lost is not None:
            time, what = self._lost
            where = "the ground" if what == "ground" else object_label(what)
            text = f"the cargo touched {where} at {number(time)} s, {away}"
        else:
            text = f"ended {away}"
        rest = "; a block stayed behind, so this part of the way does not count"
        return text + (rest if stayed and journey.left < POINTS else "")

    def _events(self) -> Iterator[RolloutEvent]:
        journey = self._journey
        if journey.turned is not None:
            yield RolloutEvent(journey.turned, "turned", (), "the target is reached")
        if journey.arrived is not None:
            yield RolloutEvent(journey.arrived, "arrived", (), "the end of the way is reached")
        if self._lost is not None:
            text = "the cargo touches something else than the machine"
            yield RolloutEvent(self._lost[0], "cargo_lost", (), text)


def _top_speed(times: Array, centres: Array) -> float:
    """Greatest mean speed between two samples, m/s."""
    if len(times) < 2:
        return 0.0
    steps = np.linalg.norm(np.diff(centres, axis=0), axis=1)
    return float((steps / np.diff(times)).max())


def _cargo_objects(cargo: Cargo, machine: Machine | None) -> Iterator[SceneObject]:
    if cargo.mass:
        reach = max(cargo.width, cargo.length) / 2
        base = highest_point_under(machine, 0.0, 0.0, reach) if machine else 0.0
        y = max(base, cargo.drop) + cargo.height / 2
        size = (cargo.width, cargo.height, cargo.length)
        yield SceneObject(
            CARGO, "box", size, (0.0, y, 0.0), mass=cargo.mass, held=bool(cargo.falls), color=COLOR
        )


def _wall_objects(knobs: Wall) -> Iterator[SceneObject]:
    if knobs.height:
        size = (knobs.length, knobs.height, THICK)
        yield wall("wall", knobs.left + knobs.length / 2, knobs.ahead, size)
