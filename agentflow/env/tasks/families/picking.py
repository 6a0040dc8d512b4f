"""The picking family: lift a ball out of a pit on a fixed schedule."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from agentflow.env.feedback.compose import compose
from agentflow.env.feedback.text import number, point_text
from agentflow.env.rollout import Array, Broken, Feedback, Moment, Trace, Verdict
from agentflow.env.scene import Scene, SceneObject, Start
from agentflow.env.tasks.base import Parameters, Schedule, WorldView
from agentflow.env.tasks.family import WOOD, CommonKnobs, Family, StartTimes, wall
from agentflow.env.tasks.knobs import knob
from agentflow.machine.blocks.library import GRABBER
from agentflow.machine.brief import Brief
from agentflow.machine.tree import Machine

BLOCKS = (0, 1, 2, 4, 9, 15, 16, 22, 27, 35, 41, 45, 63)
BALL = "ball"
DIAMETER, MASS = 2.0, 2.0
"""Diameter (m) and mass (kg) of the ball."""
BAR = 0.5
"""Thickness of the bar, m."""
GAIN = 0.05
"""Least height that counts as gained, m."""
FAR = 60.0
"""Extent of the ground around the pit, m; twice as much behind the machine."""


class Pit(Parameters):
    """A square hole in the ground."""

    opening: float = knob(7, 3, 12, "m", "width of the pit along x and z")
    depth: float = knob(3, 1, 10, "m", "depth of the pit")
    edge: float = knob(8, 4, 40, "m", "z of the pit's near edge")


class Bar(Parameters):
    """A bar along x, from the pit's left wall across its middle."""

    share: float = knob(
        0, 0, 0.5, "", "share of the opening that the bar crosses; 0 removes the bar"
    )
    below: float = knob(1, 0, 8, "m", "depth of the bar's top below the ground")


class PickingTimes(StartTimes):
    """Schedule: motors drive forward until `lower` and backward from `back` on."""

    lower: float = knob(8, 0, 60, "s", "motors stop, decouplers release, winches pay out")
    grab: float = knob(14, 0, 60, "s", "grabbers start to grip, winches stop")
    lift: float = knob(14, 0, 60, "s", "winches reel in")
    back: float = knob(22, 0, 60, "s", "winches stop, motors run backward")


class PickingKnobs(CommonKnobs):
    """Knobs of a picking level."""

    window: float = knob(26, 1, 60, "s", "length of the scored window")
    schedule: PickingTimes = PickingTimes()
    pit: Pit = Pit()
    bar: Bar = Bar()

    @property
    def control_schedule(self) -> Schedule:
        """Drive, lower, grab, lift, drive back."""
        times = self.schedule
        winches = ((times.lower, -1.0), (times.grab, 0.0), (times.lift, 1.0), (times.back, 0.0))
        at_springs = [level for start, level in winches if start <= times.springs]
        more = (
            (0.0, "grabbers", 0.0),
            (times.springs, "winches", at_springs[-1] if at_springs else 0.0),
            (times.lower, "motors", 0.0),
            (times.lower, "decouplers", 1.0),
            *((start, "winches", level) for start, level in winches),
            (times.grab, "grabbers", 1.0),
            (times.back, "motors", -1.0),
        )
        return Schedule(times.motors, times.springs, times.steering_hinges, more)

    @property
    def middle(self) -> float:
        """z of the pit's middle, m."""
        return self.pit.edge + self.pit.opening / 2

    @property
    def ball(self) -> tuple[float, float, float]:
        """Centre of the ball, m: the middle of the opening that the bar leaves."""
        return self.bar.share * self.pit.opening / 2, DIAMETER / 2, self.middle


@dataclass(frozen=True)
class Picking(Family):
    """Score: greatest height of the ball's centre above its position at t = 0, m."""

    family: ClassVar[str] = "picking"
    unit = "m"
    knobs: ClassVar[type[CommonKnobs]] = PickingKnobs
    parameters: PickingKnobs

    @property
    def brief(self) -> Brief:
        return self.tell("picking", BLOCKS, diameter=DIAMETER, mass=MASS, thick=BAR)

    def scene(self, machine: Machine | None = None) -> Scene:  # noqa: ARG002 - always the same
        """Ground around the pit (whose bottom is y = 0), bar, ball and wind."""
        knobs = self.parameters
        ball = SceneObject(
            BALL, "sphere", (DIAMETER,) * 3, knobs.ball, mass=MASS, color=(0.8, 0.3, 0.2, 1)
        )
        objects = (*_banks(knobs.pit), *_bar(knobs), ball)
        return Scene(objects, knobs.wind.velocity, start=Start(height=knobs.pit.depth))

    def referee(self, machine: Machine) -> PickingReferee:  # noqa: ARG002 - only the ball counts
        return PickingReferee(self.parameters)

    def feedback(
        self, machine: Machine, trace: Trace, broken: tuple[Broken, ...], verdict: Verdict
    ) -> Feedback:
        """Height of the ball every second, and where the grabbers were when they closed."""
        path = trace.object_position[:, trace.objects.index(BALL)]
        seconds = range(1, int(trace.times[-1] + 1e-6) + 1)
        gained = [float(_at(trace.times, path, second)[1] - path[0, 1]) for second in seconds]
        times, last = self.parameters.schedule, float(trace.times[-1])
        grab = min(times.grab, last)
        grabbers = [
            f"block {step.id} {point_text(_at(trace.times, trace.centre[:, step.id], grab))}"
            for step in machine
            if step.type == GRABBER
        ]
        root = [
            f"{point_text(_at(trace.times, trace.centre[:, 0], time))} at t = {time:g} s"
            for time in sorted({times.lower, times.back, last})
            if time <= last
        ]
        lines = (
            f"Result: {verdict.terms['result']}",
            _gain_line(gained),
            f"Ball at t = {grab:g} s: {point_text(_at(trace.times, path, grab))}",
            *([f"Grabbers at t = {grab:g} s: {'; '.join(grabbers)}"] if grabbers else []),
            f"Root: {'; '.join(root)}",
        )
        data = {"gained_per_second": gained, "ball": path[-1].tolist()}
        return compose(machine, trace, broken, verdict, self.unit, lines, data, ())


class PickingReferee:
    """Tracks the ball's centre step by step."""

    def __init__(self, knobs: PickingKnobs) -> None:
        self._knobs = knobs
        self._start = self._best = self._best_time = 0.0
        self._end = (0.0, 0.0, 0.0)

    def start(self, world: WorldView) -> None:
        """Record where the ball rests."""
        self._end = world.centre(BALL)
        self._start = self._end[1]

    def watch(self, world: WorldView) -> None:
        """Update the greatest height."""
        self._end = world.centre(BALL)
        gained = self._end[1] - self._start
        if gained > self._best:
            self._best, self._best_time = gained, world.time

    def verdict(self, trace: Trace) -> Verdict:  # noqa: ARG002
        """Score and terms: height (m), its time (s), whether the ball ends outside the pit."""
        pit = self._knobs.pit
        x, y, z = self._end
        over = abs(x) <= pit.opening / 2 and pit.edge <= z <= pit.edge + pit.opening
        outside = y > pit.depth and not over
        ends = "outside the pit" if outside else "over the pit" if y > pit.depth else "in the pit"
        terms: dict[str, float | bool | str | None] = {
            "height": self._best,
            "time": self._best_time,
            "success": outside,
            "final_height": y - self._start,
            "result": f"the ball gained {number(self._best)} m and ended {ends}",
        }
        top = Moment(self._best_time, "the ball's greatest height", BALL)
        return Verdict(self._best, terms, (), top if self._best > GAIN else None)


def _gain_line(gained: Sequence[float]) -> str:
    """The gains after each second, from the first one on."""
    idle = next((i for i, gain in enumerate(gained) if gain >= GAIN), len(gained))
    told = ", ".join(number(gain, 1) for gain in gained[idle:]) or "none"
    since = f" from t = {idle + 1} s on" if idle else ""
    return f"Height gained by the ball after each second{since} (m): {told}"


def _at(times: Array, values: Array, time: float) -> Array:
    """Row of `values` (T, 3) at the sample closest to a time, s."""
    row: Array = values[int(np.argmin(np.abs(times - time)))]
    return row


def _banks(pit: Pit) -> Iterator[SceneObject]:
    """The ground on all four sides of the pit."""
    half, deep = pit.opening / 2, pit.depth
    near, far, side = pit.edge + 2 * FAR, FAR, FAR - half
    yield wall("near ground", 0.0, pit.edge - near / 2, (2 * FAR, deep, near))
    yield wall("far ground", 0.0, pit.edge + pit.opening + far / 2, (2 * FAR, deep, far))
    for name, sign in (("left ground", -1), ("right ground", 1)):
        x = sign * (half + side / 2)
        yield wall(name, x, pit.edge + half, (side, deep, pit.opening))


def _bar(knobs: PickingKnobs) -> Iterator[SceneObject]:
    pit, bar = knobs.pit, knobs.bar
    if bar.share:
        long, top = bar.share * pit.opening, pit.depth - bar.below
        place = ((long - pit.opening) / 2, top - BAR / 2, knobs.middle)
        yield SceneObject("bar", "box", (long, BAR, BAR), place, color=WOOD)
