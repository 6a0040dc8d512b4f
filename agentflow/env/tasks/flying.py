"""Owns the flying family: climb as high as possible, or fly through hoops in order.

Platform, hoops, gusts, both scores and the default feedback; simulation is rollout.py's.
"""

from __future__ import annotations

import random
from collections.abc import Iterator
from dataclasses import dataclass
from math import cos, dist, pi, radians, sin
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from agentflow.env.feedback import compose, number, series
from agentflow.env.scene import Gust, Scene, Start, Thing, Vec3
from agentflow.env.tasks.base import Parameters, World
from agentflow.env.tasks.family import (
    GROUND,
    WOOD,
    CommonKnobs,
    Family,
    schedule_sentences,
)
from agentflow.env.tasks.knobs import knob
from agentflow.env.trace import Broken, Event, Feedback, Trace, Verdict
from agentflow.machine.brief import Brief
from agentflow.machine.tree import Machine

BLOCKS = (0, 1, 2, 7, 9, 15, 16, 22, 26, 35, 41, 55, 63)
FLYING_BLOCK = 14
"""Only where marks are to be passed: one alone would climb for ever."""
POINTS = 10.0
"""Of a hoop that is passed, and of the closest way to the next one (spec 3)."""
SIDES, RIM = 16, 0.3
"""Straight pieces of a hoop, and their thickness, m."""
PLATE = 0.5
"""Thickness of the platform, m."""
WAVES = ((0.5, 2.0), (0.3, 1.1), (0.2, 0.6))
"""Share of the swing and period (s) of each wave of the gusts."""


class Platform(Parameters):
    """What the machine stands on."""

    angle: float = knob(0, -30, 30, "degrees", "how far its z+ end is raised")
    height: float = knob(0, 0, 10, "m", "height of its middle; 0 removes it")
    side: float = knob(20, 18, 40, "m", "length of its sides")


class Gusts(Parameters):
    """How the wind's speed swings about its mean."""

    swing: float = knob(0, 0, 1, "", "how far it swings, as a share of the mean")
    seed: int = knob(5, 0, 1_000_000, "", "of the gusts")


class Hoops(Parameters):
    """Upright hoops across the way, one behind the other."""

    count: int = knob(3, 1, 10, "", "how many there are")
    radius: float = knob(4, 1, 10, "m", "inner radius")
    spacing: float = knob(25, 10, 100, "m", "from one to the next; the first as far from z = 0")
    low: float = knob(10, 5, 50, "m", "least height of a centre")
    high: float = knob(20, 5, 50, "m", "greatest height of a centre")
    seed: int = knob(4, 0, 1_000_000, "", "of the heights")


class FlyingKnobs(CommonKnobs):
    """What can be set about a flying level."""

    window: float = knob(10, 1, 60, "s", "length of the scored window")
    mode: Literal["altitude", "marks"] = Field(
        "altitude",
        description="altitude, or marks: hoops to be passed in order",
        json_schema_extra={"unit": "altitude or marks"},
    )
    platform: Platform = Platform()
    gusts: Gusts = Gusts()
    hoops: Hoops = Hoops()


@dataclass(frozen=True)
class Flying(Family):
    """Score: greatest height of the root's centre above its place at t = 0, m; or marks.

    Marks: 10 for every hoop that the root's centre passes in order, from z- to z+ within the inner
    radius, plus max(0, 10 - its closest distance in metres to the next hoop's centre since the
    last one was passed).
    """

    family: ClassVar[str] = "flying"
    knobs: ClassVar[type[CommonKnobs]] = FlyingKnobs
    parameters: FlyingKnobs

    @property
    def marks(self) -> tuple[Vec3, ...]:
        """Centres of the hoops in order; () where altitude counts."""
        return hoop_centres(self.parameters.hoops) if self.parameters.mode == "marks" else ()

    @property
    def brief(self) -> Brief:
        """What designers are told and what validity checks."""
        knobs = self.parameters
        blocks = tuple(sorted((*BLOCKS, FLYING_BLOCK))) if self.marks else BLOCKS
        return Brief(
            name=self.name,
            objective="Build a machine that flies through the hoops ahead, one after the other."
            if self.marks
            else "Build a machine that flies as high as possible.",
            scene=(
                *(_platform_sentences(knobs.platform) if knobs.platform.height else GROUND),
                *_hoop_sentences(self.marks, knobs.hoops),
                *knobs.wind.sentences(),
                *_gust_sentences(knobs),
            ),
            schedule=schedule_sentences(self.schedule, self.window, blocks),
            score=_mark_score(self.window) if self.marks else _altitude_score(self.window),
            blocks=blocks,
        )

    def scene(self, machine: Machine | None = None) -> Scene:  # noqa: ARG002
        """Platform, hoops, wind."""
        knobs = self.parameters
        platform = knobs.platform
        start = Start(platform.height, platform.angle) if platform.height else Start()
        things = (*_platform(platform), *_hoops(self.marks, knobs.hoops.radius))
        return Scene(things, knobs.wind.velocity, gusts_of(knobs.gusts), start)

    def referee(self, machine: Machine) -> FlightReferee:  # noqa: ARG002 - the root is block 0
        """A fresh observer of the root."""
        return FlightReferee(self.marks, self.parameters.hoops.radius)

    def feedback(
        self, machine: Machine, trace: Trace, broken: tuple[Broken, ...], verdict: Verdict
    ) -> Feedback:
        """Heights, marks and the root's path (spec 3.2)."""
        terms = verdict.terms
        rise = np.diff(trace.centre[:, 0, 1]) / np.diff(trace.times)
        climb = float(rise.max()) if len(rise) else 0.0
        lines = [
            f"Root: greatest height {number(float(terms['height'] or 0.0))} m above its start at "
            f"{number(float(terms['time'] or 0.0))} s, ends {number(float(terms['end'] or 0.0))} m "
            f"above it, greatest climb {number(climb)} m/s",
        ]
        if self.marks:
            lines.append(f"Marks: {terms['result']}")
        path = series("Root position", trace.times, trace.centre[:, 0])
        unit = "" if self.marks else "m"
        data = {"greatest_climb": climb}
        return compose(machine, trace, broken, verdict, unit, lines, data, (path,))


class FlightReferee:
    """Follows the root's centre step by step."""

    def __init__(self, marks: tuple[Vec3, ...], radius: float) -> None:
        self._marks, self._radius = marks, radius
        self._start = self._last = (0.0, 0.0, 0.0)
        self._height = self._time = 0.0
        self._passed: list[float] = []
        """When each hoop was passed, s."""
        self._closest = float("inf")
        """To the centre of the next hoop, since the last was passed, m."""

    def start(self, world: World) -> None:
        """Remember where the root rests."""
        self._start = self._last = world.centre(0)
        self._near(self._start)

    def watch(self, world: World) -> None:
        """Keep the greatest height, the hoops passed and the closest way to the next."""
        place = world.centre(0)
        if place[1] - self._start[1] > self._height:
            self._height, self._time = place[1] - self._start[1], world.time
        self._near(place)
        if self._passes(place):
            self._passed.append(world.time)
            self._closest = float("inf")
            self._near(place)
        self._last = place

    @property
    def _next(self) -> Vec3 | None:
        count = len(self._passed)
        return self._marks[count] if count < len(self._marks) else None

    def _near(self, place: Vec3) -> None:
        if self._next is not None:
            self._closest = min(self._closest, dist(place, self._next))

    def _passes(self, place: Vec3) -> bool:
        """Whether the last step crossed the next hoop's plane forward, within the hoop."""
        hoop, last = self._next, self._last
        if hoop is None or not last[2] < hoop[2] <= place[2]:
            return False
        share = (hoop[2] - last[2]) / (place[2] - last[2])
        x, y = (a + share * (b - a) for a, b in zip(last[:2], place[:2], strict=True))
        return dist((x, y), hoop[:2]) <= self._radius

    def verdict(self, trace: Trace) -> Verdict:  # noqa: ARG002
        """Score, terms and events; what marks tell is None where altitude counts."""
        passed, total = len(self._passed), len(self._marks)
        near = None if self._next is None else self._closest
        bonus = 0.0 if near is None else max(0.0, POINTS - near)
        result = f"passed: {passed} of {total}"
        if near is not None:
            result += f", closest to the centre of hoop {passed + 1}: {number(near)} m"
        terms: dict[str, float | bool | str | None] = {
            "height": self._height,
            "time": self._time,
            "end": self._last[1] - self._start[1],
            "drift": dist(self._last[::2], self._start[::2]),
            "passed": float(passed) if total else None,
            "closest": near,
            "result": result if total else None,
        }
        events = tuple(
            Event(time, "hoop_passed", (0,), f"the Starting Block passes hoop {index}")
            for index, time in enumerate(self._passed, start=1)
        )
        score = POINTS * passed + bonus if total else self._height
        return Verdict(score, terms, events)


def hoop_centres(knobs: Hoops) -> tuple[Vec3, ...]:
    """Centres of the hoops, m: evenly along z, at heights by chance."""
    chance = random.Random(f"{knobs.seed}/hoops")
    low, high = sorted((knobs.low, knobs.high))
    return tuple(
        (0.0, round(chance.uniform(low, high), 1), index * knobs.spacing)
        for index in range(1, knobs.count + 1)
    )


def gusts_of(knobs: Gusts) -> tuple[Gust, ...]:
    """Waves whose shares add up to the swing; their phases are the seed's."""
    if not knobs.swing:
        return ()
    chance = random.Random(f"{knobs.seed}/gusts")
    return tuple(
        Gust(knobs.swing * share, period, round(chance.uniform(0, 2 * pi), 3))
        for share, period in WAVES
    )


def _platform(knobs: Platform) -> Iterator[Thing]:
    """A plate whose upper surface goes through (0, height, 0)."""
    if knobs.height:
        tilt = radians(knobs.angle)
        middle = (0.0, knobs.height - PLATE / 2 * cos(tilt), PLATE / 2 * sin(tilt))
        turned = (-sin(tilt / 2), 0.0, 0.0, cos(tilt / 2))
        size = (knobs.side, PLATE, knobs.side)
        yield Thing("platform", "box", size, middle, turned, color=WOOD)


def _hoops(centres: tuple[Vec3, ...], radius: float) -> Iterator[Thing]:
    """Rims of straight pieces outside the inner radius."""
    middle = radius + RIM / 2
    length = 2 * (radius + RIM) * sin(pi / SIDES)
    for number_, (x, y, z) in enumerate(centres, start=1):
        for side in range(SIDES):
            turn = 2 * pi * side / SIDES
            place = (x - middle * sin(turn), y + middle * cos(turn), z)
            rolled = (0.0, 0.0, sin(turn / 2), cos(turn / 2))
            yield Thing(
                f"hoop {number_} {side}", "box", (length, RIM, RIM), place, rolled, color=WOOD
            )


def _platform_sentences(knobs: Platform) -> tuple[str, ...]:
    tilt = (
        f"tilted by {abs(knobs.angle):g} degrees, its z{'+' if knobs.angle > 0 else '-'} end raised"
        if knobs.angle
        else "level"
    )
    return (
        "The ground is flat, at y = 0; z+ is the target direction.",
        f"The machine stands on a square platform with sides of {knobs.side:g} m, {tilt}; the "
        f"middle of its upper surface is at x = z = 0, {knobs.height:g} m above the ground.",
        "The machine is put down turned with the platform: its lowest face on the surface, the "
        "centre of its bounding box over the middle.",
    )


def _hoop_sentences(centres: tuple[Vec3, ...], knobs: Hoops) -> tuple[str, ...]:
    if not centres:
        return ()
    places = ", ".join(f"({x:g}, {y:g}, {z:g})" for x, y, z in centres)
    return (
        f"Upright hoops, {len(centres)} of them, of inner radius {knobs.radius:g} m, stand across "
        f"the way, their centres at (x, y, z) = {places} m; their rims are solid.",
    )


def _gust_sentences(knobs: FlyingKnobs) -> tuple[str, ...]:
    mean = sum(v * v for v in knobs.wind.velocity) ** 0.5
    if not knobs.gusts.swing or not mean:
        return ()
    swing = knobs.gusts.swing
    low, high = mean * (1 - swing), mean * (1 + swing)
    return (
        f"From t = 0 on it is steady no more: it comes in gusts about this mean, in the same "
        f"direction, its speed changing within a second or two between {low:g} and {high:g} m/s.",
    )


def _altitude_score(window: float) -> tuple[str, ...]:
    return (
        "Score: the greatest height in metres of the Starting Block's centre above its place at "
        f"t = 0, within {window:g} s.",
        "Sideways motion counts nothing; what moves before t = 0 counts nothing.",
    )


def _mark_score(window: float) -> tuple[str, ...]:
    return (
        f"Score: {POINTS:g} for every hoop that the Starting Block's centre passes in order, "
        f"within {window:g} s, plus {POINTS:g} minus its closest distance in metres to the centre "
        "of the next hoop (at least 0).",
        "A hoop is passed from its z- side to its z+ side, within its inner radius.",
    )
