"""The rocket family: thrust, height and a soft landing, with water cannons and torches."""

from __future__ import annotations

import random
from dataclasses import dataclass, replace
from math import hypot
from typing import Any, ClassVar, Literal

from agentflow.env.constants import constants
from agentflow.env.feedback.compose import compose
from agentflow.env.feedback.text import flight_lines, number, series
from agentflow.env.rollout import Broken, Feedback, Moment, Trace, Verdict
from agentflow.env.scene import Scene, blocks_among
from agentflow.env.tasks.base import GENERAL, ROUNDING, Descriptor, Parameters, WorldView
from agentflow.env.tasks.family import TRIALS, CommonKnobs, Family
from agentflow.env.tasks.features.flights import CannonWatch
from agentflow.env.tasks.knobs import choice, knob
from agentflow.machine.blocks.library import TORCH, WATER_CANNON, library
from agentflow.machine.brief import Brief
from agentflow.machine.tree import Machine

BLOCKS = (0, 1, 7, 15, 35, 41, TORCH, WATER_CANNON, 63)
Aim = Literal["thrust", "height", "landing"]
FREE = 0.5
"""Time at which a rocket on the stand must have left the ground, s."""
SPAN = 0.5
"""Time after that over which its thrust is measured, s."""
HIGH = 30.0
"""Height from which on a flight is a success, as the other public benchmark counts, m."""
ALOFT = 1.0
"""Height above which the greatest height is reported as decisive, m."""


class Gale(Parameters):
    """Winds that designers are not told, in ten trials of a landing."""

    wind: float = knob(
        0, 0, 5, "m/s", "greatest wind up, down and aside that trials draw; 0: no trials"
    )
    height: float = knob(8, 1, 100, "m", "height that a trial must reach")
    pad: float = knob(6, 1, 50, "m", "greatest distance from the start at which it may land")

    def draw(self, rng: random.Random) -> dict[str, float]:
        """The wind of a trial, as knobs of `Wind`."""
        return {way: round(rng.uniform(-self.wind, self.wind), 2) for way in ("down", "cross")}


class RocketKnobs(CommonKnobs):
    """Knobs of a rocket level."""

    window: float = knob(30, 2, 60, "s", "length of the scored window")
    aim: Aim = choice(
        "height",
        "thrust, height or landing",
        "thrust: push up; height: climb; landing: climb and land softly",
    )
    engines: int = knob(0, 0, 6, "", "exact number of water cannons, and of torches; 0: any")
    corridor: float = knob(
        0, 0, 1000, "m", "distance from the vertical up to which height and landings count; 0: any"
    )
    touchdown: float = knob(8, 1, 50, "m/s", "greatest speed at which a landing is soft")
    gale: Gale = Gale()
    """Of aim `landing`."""

    @property
    def trials(self) -> int:
        return TRIALS if self.gale.wind and self.aim == "landing" else 1


@dataclass(frozen=True)
class Rocket(Family):
    """Score: upward thrust, N; or greatest height of the root's centre above its start, m.

    Height counts up to where the root leaves the corridor. With aim `landing` it counts only if the
    rocket comes back and its first touch of the ground is in the corridor and slower than the
    limit. In a gale: the number of trials out of ten that land so, near the start.
    """

    family: ClassVar[str] = "rocket"
    knobs: ClassVar[type[CommonKnobs]] = RocketKnobs
    descriptors: ClassVar[tuple[Descriptor, ...]] = GENERAL[:2]
    parameters: RocketKnobs

    def draw(self, rng: random.Random) -> dict[str, Any]:
        """The wind of the gale."""
        knobs = self.parameters
        wind = knobs.wind.model_copy(update=knobs.gale.draw(rng))
        return {"parameters": knobs.model_copy(update={"wind": wind})}

    @property
    def unit(self) -> str:
        """As in `Task`."""
        return (
            "N" if self.parameters.aim == "thrust" else "m" if self.parameters.trials == 1 else ""
        )

    @property
    def brief(self) -> Brief:
        count, trials = self.parameters.engines, self.parameters.trials
        return replace(
            self.tell("rocket", BLOCKS, free=FREE, span=SPAN),
            required={TORCH: count, WATER_CANNON: count} if count else {},
            greatest=float(trials) if trials > 1 else None,
        )

    def scene(self, machine: Machine | None = None) -> Scene:  # noqa: ARG002
        """Flat ground and wind."""
        return Scene((), self.parameters.wind.velocity)

    def referee(self, machine: Machine) -> RocketReferee:
        return RocketReferee(machine, self.parameters)

    def feedback(
        self, machine: Machine, trace: Trace, broken: tuple[Broken, ...], verdict: Verdict
    ) -> Feedback:
        """What was reached, what each cannon did, and the path of the root."""
        even = trace.even
        fired = verdict.terms["cannons"]
        lines = (
            f"Result: {verdict.terms['result']}",
            *([f"Water cannons: {fired}"] if fired else []),
            *flight_lines(machine, even),
        )
        path = series("Root position", even.times, even.centre[:, 0])
        return compose(machine, trace, broken, verdict, self.unit, lines, {}, (path,))


class RocketReferee:
    """Tracks the root and the centre of mass step by step."""

    def __init__(self, machine: Machine, knobs: RocketKnobs) -> None:
        self._knobs = knobs
        self._masses = [(step.id, library()[step.type].mass) for step in machine]
        self._mass = sum(mass for _, mass in self._masses)
        self._cannons = CannonWatch(machine)
        self._heights: list[float] = []
        """Heights of the centre of mass as the measurement begins, in its middle and at its end."""
        self._grounded = False
        """Whether it stood on the ground as the measurement began."""
        self._start = self._last = (0.0, 0.0, 0.0)
        self._best = self._best_time = self._aside = 0.0
        self._left = False
        """Whether it has left the corridor."""
        self._before = (0.0, (0.0, 0.0, 0.0))
        """Time and place of the root in the step before."""
        self._speed = 0.0
        self._touch: float | None = None
        """Speed at the first touch of the ground after it was aloft, m/s."""
        self._apart = 0.0
        """How far from where it started the root was then, in plan, m."""
        self._aloft = False

    def start(self, world: WorldView) -> None:
        """Record where the root rests."""
        self._start = self._last = world.centre(0)
        self._before = 0.0, self._start

    def watch(self, world: WorldView) -> bool:
        """Update thrust, height, landing and what the cannons did; a landing ends a trial."""
        self._cannons.watch(world)
        place = self._last = world.centre(0)
        touching = bool(blocks_among(world.touching("ground")))
        self._measure_thrust(world, touching)
        self._watch_height(world.time, place)
        time, before = self._before
        if self._aloft and touching and self._touch is None:
            self._touch = self._speed
            self._apart = hypot(place[0] - self._start[0], place[2] - self._start[2])
        if world.time > time:
            moved = [(b - a) / (world.time - time) for a, b in zip(before, place, strict=True)]
            self._speed = hypot(*moved)
        self._before = world.time, place
        return self._knobs.trials > 1 and self._touch is not None

    def _measure_thrust(self, world: WorldView, touching: bool) -> None:
        due = FREE + len(self._heights) * SPAN / 2
        if len(self._heights) < 3 and world.time >= due - ROUNDING:
            if not self._heights:
                self._grounded = touching
            total = sum(mass * world.centre(block)[1] for block, mass in self._masses)
            self._heights.append(total / self._mass)

    def _watch_height(self, time: float, place: tuple[float, float, float]) -> None:
        rise = place[1] - self._start[1]
        aside = hypot(place[0] - self._start[0], place[2] - self._start[2])
        down = self._touch is not None and self._knobs.aim == "landing"
        self._left = self._left or (not down and 0.0 < self._knobs.corridor < aside)
        if self._left or down or rise <= self._best:
            return
        self._best, self._best_time, self._aside = rise, time, aside
        self._aloft = rise > ALOFT

    @property
    def thrust(self) -> float:
        """Upward force on the whole machine without gravity, N; 0 if it stays on the ground."""
        if len(self._heights) < 3 or self._grounded:
            return 0.0
        low, middle, high = self._heights
        gain = (high - 2 * middle + low) / (SPAN / 2) ** 2
        return max(0.0, self._mass * (gain + constants()["gravity"]))

    def verdict(self, trace: Trace) -> Verdict:  # noqa: ARG002
        """Score and terms: thrust (N), height, deviation (m), touchdown (m/s), cost in blocks, what
        the cannons did."""
        knobs, thrust = self._knobs, self.thrust
        weight = self._mass * constants()["gravity"]
        soft = self._touch is not None and self._touch <= knobs.touchdown
        soft = soft and (knobs.corridor == 0.0 or self._apart <= knobs.corridor)
        score = {
            "thrust": thrust,
            "height": self._best,
            "landing": self._best if soft else 0.0,
        }[knobs.aim]
        terms: dict[str, float | bool | str | None] = {
            "thrust": thrust,
            "thrust_over_weight": thrust / weight,
            "height": self._best,
            "deviation": self._aside,
            "left_corridor": self._left,
            "touchdown": self._touch,
            "success": thrust > weight if knobs.aim == "thrust" else score > HIGH,
            "blocks": float(len(self._masses)),
            "result": self._result(),
            "cannons": self._cannons.text or None,
        }
        if knobs.trials > 1:
            met = soft and self._best >= knobs.gale.height and self._apart <= knobs.gale.pad
            told = f"rose {number(self._best)} m and did not land"
            if self._touch is not None:
                told = (
                    f"rose {number(self._best)} m and touched the ground at {number(self._touch)} "
                    f"m/s, {number(self._apart)} m from the start"
                )
            score = float(met)
            terms |= {"success": met, "outcome": told, "miss": None}
        top = Moment(self._best_time, "the greatest height") if self._aloft else None
        return Verdict(score, terms, (), top)

    def _result(self) -> str:
        if self._knobs.aim == "thrust":
            return f"thrust {number(self.thrust)} N, mass {number(self._mass)} kg"
        told = (
            f"greatest height {number(self._best)} m at {number(self._best_time)} s, "
            f"{number(self._aside)} m from the vertical"
        )
        told += "; then it left the corridor" * self._left
        if self._knobs.aim == "height":
            return told
        if self._touch is None:
            return f"{told}; it did not land"
        landed = f"{told}; it touched the ground again at {number(self._touch)} m/s"
        return landed + f", {number(self._apart)} m from the start" * bool(self._knobs.corridor)
