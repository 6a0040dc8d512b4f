"""The flying family: climb as high as possible, or fly through hoops in order."""

from __future__ import annotations

import random
from dataclasses import dataclass, replace
from math import dist, hypot, pi
from typing import ClassVar, Literal

import numpy as np

from agentflow.env.feedback.compose import compose
from agentflow.env.feedback.text import flight_lines, number, series
from agentflow.env.rollout import Broken, Feedback, Moment, RolloutEvent, Trace, Verdict
from agentflow.env.scene import Gust, Scene
from agentflow.env.tasks.base import Parameters, WorldView
from agentflow.env.tasks.family import CommonKnobs, Family
from agentflow.env.tasks.features.platforms import SIDE, Platform
from agentflow.env.tasks.features.rings import CLOSE, EACH, THICK, Ring, RingProgress, ring_objects
from agentflow.env.tasks.knobs import choice, knob
from agentflow.machine.brief import Brief
from agentflow.machine.tree import Machine

BLOCKS = (0, 1, 2, 7, 9, 15, 16, 22, 26, 35, 41, 55, 63)
FLYING_BLOCK = 14
"""Allowed only in mode `marks`: in mode `altitude`, one block alone would climb forever."""
ALOFT = 0.5
"""Height above which the greatest height is reported as decisive, m."""
COST = 1.0
"""Points lost per metre from the next hoop's centre."""
WAVES = ((0.5, 2.0), (0.3, 1.1), (0.2, 0.6))
"""Share of the swing and period (s) of each wave of the gusts."""


class Gusts(Parameters):
    """Variation of the wind's speed about its mean."""

    swing: float = knob(0, 0, 1, "", "amplitude, as a share of the mean speed")
    seed: int = knob(5, 0, 1_000_000, "", "random seed of the gusts")


class Hoops(Parameters):
    """A row of upright hoops."""

    count: int = knob(3, 1, 10, "", "number of hoops")
    radius: float = knob(4, 1, 10, "m", "inner radius")
    spacing: float = knob(25, 10, 100, "m", "distance between hoops, and of the first from z = 0")
    low: float = knob(10, 5, 50, "m", "minimum height of a centre")
    high: float = knob(20, 5, 50, "m", "maximum height of a centre")
    seed: int = knob(4, 0, 1_000_000, "", "random seed of the heights")


class FlyingKnobs(CommonKnobs):
    """Knobs of a flying level."""

    window: float = knob(10, 1, 60, "s", "length of the scored window")
    mode: Literal["altitude", "marks"] = choice(
        "altitude", "altitude or marks", "altitude: climb; marks: pass the hoops in order"
    )
    platform: Platform = Platform()
    gusts: Gusts = Gusts()
    hoops: Hoops = Hoops()


@dataclass(frozen=True)
class Flying(Family):
    """Score: greatest height of the root's centre above its position at t = 0, m.

    In mode `marks`: 10 for every hoop that the root's centre passes in order, from z- to z+ within
    the inner radius, plus max(0, 10 - its closest distance in metres to the next hoop's centre
    since the last one was passed).
    """

    family: ClassVar[str] = "flying"
    knobs: ClassVar[type[CommonKnobs]] = FlyingKnobs
    parameters: FlyingKnobs

    @property
    def marks(self) -> tuple[Ring, ...]:
        """The hoops in order; () in mode `altitude`."""
        return hoops_of(self.parameters.hoops) if self.parameters.mode == "marks" else ()

    @property
    def unit(self) -> str:
        """As in `Task`."""
        return "" if self.marks else "m"

    @property
    def brief(self) -> Brief:
        knobs, hoops = self.parameters, self.marks
        brief = self.tell(
            "flying",
            (*BLOCKS, FLYING_BLOCK) if hoops else BLOCKS,
            hoops=hoops,
            mean=hypot(*knobs.wind.velocity),
            side=SIDE,
            thick=THICK,
            each=EACH,
            close=CLOSE,
        )
        return replace(brief, greatest=EACH * len(hoops) or None)

    def scene(self, machine: Machine | None = None) -> Scene:  # noqa: ARG002
        """Platform, hoops and wind."""
        knobs = self.parameters
        objects = (*knobs.platform.objects(), *ring_objects(self.marks, "hoop"))
        return Scene(objects, knobs.wind.velocity, gusts_of(knobs.gusts), knobs.platform.start)

    def referee(self, machine: Machine) -> FlightReferee:  # noqa: ARG002 - the root is block 0
        return FlightReferee(self.marks)

    def feedback(
        self, machine: Machine, trace: Trace, broken: tuple[Broken, ...], verdict: Verdict
    ) -> Feedback:
        """Heights, hoops passed and path of the root."""
        terms = verdict.terms
        even = trace.even
        rise = np.diff(even.centre[:, 0, 1]) / np.diff(even.times)
        climb = float(rise.max()) if len(rise) else 0.0
        lines = [
            f"Root: greatest height {number(float(terms['height'] or 0.0))} m above its start at "
            f"{number(float(terms['time'] or 0.0))} s, ends {number(float(terms['end'] or 0.0))} m "
            f"above it, fastest climb {number(climb)} m/s"
        ]
        if self.marks:
            lines.append(f"Hoops: {terms['result']}")
        lines += flight_lines(machine, even)
        path = series("Root position", even.times, even.centre[:, 0])
        data = {"greatest_climb": climb}
        return compose(machine, trace, broken, verdict, self.unit, lines, data, (path,))


class FlightReferee:
    """Tracks the root's centre step by step."""

    def __init__(self, marks: tuple[Ring, ...]) -> None:
        self._total = len(marks)
        self._progress = RingProgress(marks, COST)
        self._start = self._last = (0.0, 0.0, 0.0)
        self._height = self._time = 0.0
        self._passed: list[float] = []
        """Time at which each hoop was passed, s."""

    def start(self, world: WorldView) -> None:
        """Record where the root rests."""
        self._start = self._last = world.centre(0)
        self._progress.move_to(self._start)

    def watch(self, world: WorldView) -> None:
        """Update the greatest height and the hoops passed."""
        position = self._last = world.centre(0)
        if position[1] - self._start[1] > self._height:
            self._height, self._time = position[1] - self._start[1], world.time
        self._progress.move_to(position)
        self._passed += [world.time] * (self._progress.passed - len(self._passed))

    def verdict(self, trace: Trace) -> Verdict:  # noqa: ARG002
        """Score, terms and events; terms about hoops are None in mode `altitude`."""
        passed, total = self._progress.passed, self._total
        near = None if passed == total else self._progress.closest
        result = f"{passed} of {total} passed"
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
            RolloutEvent(time, "hoop_passed", (0,), f"the Starting Block passes hoop {index}")
            for index, time in enumerate(self._passed, start=1)
        )
        top = Moment(self._time, "the greatest height") if self._height > ALOFT else None
        return Verdict(self._progress.score if total else self._height, terms, events, top)


def hoops_of(knobs: Hoops) -> tuple[Ring, ...]:
    """The hoops: evenly spaced along z, at random heights."""
    rng = random.Random(f"{knobs.seed}/hoops")
    low, high = sorted((knobs.low, knobs.high))
    return tuple(
        Ring((0.0, round(rng.uniform(low, high), 1), index * knobs.spacing), knobs.radius)
        for index in range(1, knobs.count + 1)
    )


def gusts_of(knobs: Gusts) -> tuple[Gust, ...]:
    """Waves with random phases whose amplitudes add up to the swing."""
    if not knobs.swing:
        return ()
    rng = random.Random(f"{knobs.seed}/gusts")
    return tuple(
        Gust(knobs.swing * share, period, round(rng.uniform(0, 2 * pi), 3))
        for share, period in WAVES
    )
