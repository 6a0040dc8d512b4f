"""The lifting family: raise an object placed on the machine and keep it up, in ten trials."""

from __future__ import annotations

import random
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal

from pydantic import model_validator

from agentflow.env.feedback.compose import compose
from agentflow.env.feedback.text import number, series
from agentflow.env.rollout import Broken, Feedback, Moment, RolloutEvent, Trace, Verdict
from agentflow.env.scene import Scene, SceneObject, blocks_among
from agentflow.env.tasks.base import ROUNDING, Parameters, WorldView
from agentflow.env.tasks.family import TRIALS, CommonKnobs, TrialFamily, vary
from agentflow.env.tasks.features.resting import highest_point_under
from agentflow.env.tasks.knobs import choice, knob
from agentflow.errors import ConfigError
from agentflow.machine.brief import Brief
from agentflow.machine.tree import Machine

BLOCKS = (0, 1, 2, 5, 7, 9, 13, 15, 16, 19, 22, 28, 35, 41, 44, 63)
OBJECT = "object"
RISE = 1.0
"""Height above its settled position at which the object counts as lifted, m."""
HOLD = 1.0
"""Time that the object must stay lifted, s."""
LEAST = 0.1
"""Rise above which the object's greatest height is reported as decisive, m."""
LOOSE = 0.2
"""Time without contact after which the machine no longer holds the object, s."""
COLOR = (0.2, 0.45, 0.7, 1.0)
SHAPES = {"box": "box", "ball": "sphere", "cone": "cone"}


class Object(Parameters):
    """The object to lift."""

    shape: Literal["box", "ball", "cone"] = choice(
        "box", "box, ball or cone", "box, ball or cone (tip up)"
    )
    width: float = knob(2, 0.5, 5, "m", "size along x and z; diameter of a ball")
    height: float = knob(1, 0.5, 5, "m", "size along y; ignored for a ball")
    mass: float = knob(5, 0.5, 50, "", "mass")
    balance: float = knob(0, -2, 2, "m", "offset of the centre of mass towards x+")
    offset: float = knob(0, -2, 2, "m", "initial x of its centre")
    forward: float = knob(0, -2, 2, "m", "initial z of its centre")
    friction: float = knob(0.8, 0, 2, "", "friction coefficient")

    @model_validator(mode="after")
    def _balanced(self) -> Object:
        if abs(self.balance) > self.width / 2:
            raise ConfigError(
                f"object.balance is {self.balance:g}; for an object {self.width:g} m wide it must "
                f"be from {-self.width / 2:g} to {self.width / 2:g}"
            )
        return self

    @property
    def extents(self) -> tuple[float, float, float]:
        """Full extents, m."""
        return (self.width, self.width if self.shape == "ball" else self.height, self.width)


class LiftVariation(Parameters):
    """Largest deviation of a trial from the level, in either direction."""

    mass: float = knob(0.1, 0, 0.5, "", "relative variation of the object's mass")
    offset: float = knob(0.1, 0, 1, "m", "variation of its initial x and z")
    friction: float = knob(0.1, 0, 0.5, "", "relative variation of its friction")


class LiftingKnobs(CommonKnobs):
    """Knobs of a lifting level."""

    object: Object = Object()
    variation: LiftVariation = LiftVariation()

    @property
    def trials(self) -> int:
        return TRIALS


@dataclass(frozen=True)
class Lifting(TrialFamily):
    """Score: number of successful trials out of ten.

    A trial succeeds if the object's centre stays at least 1 m above its height at t = 0 for one
    second without a break, is still that high at the end, and the machine is holding it then: an
    object that was thrown or rests on something else does not count.
    """

    family: ClassVar[str] = "lifting"
    knobs: ClassVar[type[CommonKnobs]] = LiftingKnobs
    ranked: ClassVar[bool] = True
    parameters: LiftingKnobs

    def draw(self, rng: random.Random) -> dict[str, Any]:
        """Vary mass, friction and initial position of the object."""
        knobs, by = self.parameters, self.parameters.variation
        item = knobs.object
        changed = {
            "mass": vary(rng, item.mass, by.mass),
            "friction": vary(rng, item.friction, by.friction),
            "offset": item.offset + round(rng.uniform(-by.offset, by.offset), 3),
            "forward": item.forward + round(rng.uniform(-by.offset, by.offset), 3),
        }
        varied = knobs.model_copy(update={"object": item.model_copy(update=changed)})
        return {"parameters": varied}

    @property
    def brief(self) -> Brief:
        brief = self.tell("lifting", BLOCKS, rise=RISE, hold=HOLD, loose=LOOSE)
        return replace(brief, greatest=float(TRIALS))

    def scene(self, machine: Machine | None = None) -> Scene:
        """The object, on top of the machine if there is one, and wind."""
        knobs = self.parameters.object
        x, z = knobs.offset, knobs.forward
        base = highest_point_under(machine, x, z, knobs.width / 2) if machine else 0.0
        item = SceneObject(
            OBJECT,
            SHAPES[knobs.shape],  # type: ignore[arg-type]
            knobs.extents,
            (x, base + knobs.extents[1] / 2, z),
            mass=knobs.mass,
            friction=knobs.friction,
            balance=(knobs.balance, 0.0, 0.0),
            color=COLOR,
        )
        return Scene((item,), self.parameters.wind.velocity)

    def referee(self, machine: Machine) -> LiftReferee:  # noqa: ARG002 - only the object counts
        return LiftReferee(self.window)

    def feedback(
        self, machine: Machine, trace: Trace, broken: tuple[Broken, ...], verdict: Verdict
    ) -> Feedback:
        """Outcome of the trial and path of the object."""
        item = self.parameters.object
        lines = (
            f"Result: {verdict.terms['outcome']}",
            f"Conditions: object of mass {number(item.mass)}, friction {number(item.friction)}, "
            f"placed above x = {number(item.offset)}, z = {number(item.forward)} m",
        )
        path = series("Object position", trace.even.times, trace.even.object_position[:, 0])
        return compose(machine, trace, broken, verdict, "", lines, {}, (path,))


class LiftReferee:
    """Tracks the object's height step by step.

    A rollout ends early only when everything is at rest, so an object that is up then stays up for
    the rest of the window.
    """

    def __init__(self, window: float) -> None:
        self._window = window
        self._settled = self._rise = self._best = self._best_time = 0.0
        self._since: float | None = None
        """Time since which the object has been up; None while it is not."""
        self._held = 0.0
        """Longest time that it has been up without a break, s."""
        self._touched = self._now = 0.0
        """Times of its last contact with the machine and of the last step, s."""
        self._first: float | None = None

    def start(self, world: WorldView) -> None:
        """Record the object's settled height."""
        self._settled = world.centre(OBJECT)[1]

    def watch(self, world: WorldView) -> None:
        """Update the greatest rise, the longest time up and the last contact."""
        self._now = world.time
        if blocks_among(world.touching(OBJECT)):
            self._touched = world.time
        self._rise = world.centre(OBJECT)[1] - self._settled
        if self._rise > self._best:
            self._best, self._best_time = self._rise, world.time
        if self._rise < RISE:
            self._since = None
            return
        self._since = world.time if self._since is None else self._since
        self._first = world.time if self._first is None else self._first
        self._held = max(self._held, world.time - self._since)

    def verdict(self, trace: Trace) -> Verdict:  # noqa: ARG002
        """Whether and how the trial succeeded or failed."""
        if self._since is not None:
            self._held = max(self._held, self._window - self._since)
        carried = self._now - self._touched <= LOOSE + ROUNDING
        success = self._since is not None and self._held >= HOLD - ROUNDING and carried
        terms: dict[str, float | bool | str | None] = {
            "success": success,
            "outcome": self._outcome(success, carried),
            "miss": None if self._since is not None else RISE - self._rise,
            "settled_height": self._settled,
            "greatest_rise": self._best,
            "final_rise": self._rise,
            "held": self._held,
            "carried": carried,
        }
        name = "the object's greatest height"
        top = Moment(self._best_time, name, OBJECT) if self._best > LEAST else None
        return Verdict(float(success), terms, self._events(), top)

    def _outcome(self, success: bool, carried: bool) -> str:
        best = f"highest {number(self._best)} m at {number(self._best_time)} s"
        if success:
            held = f"up for {number(self._held)} s"
            return f"success, {held}, {best}, ends {number(self._rise)} m up"
        if self._since is not None and not carried:
            away = number(self._now - self._touched)
            return f"failed, up but off the machine for the last {away} s, {best}"
        if self._since is not None:
            return f"failed, up for only {number(self._held)} s, {best}"
        if self._first is None:
            return f"failed, never rose {RISE:g} m, {best}, ends {number(self._rise)} m up"
        return f"failed, up for {number(self._held)} s but ends {number(self._rise)} m up, {best}"

    def _events(self) -> tuple[RolloutEvent, ...]:
        text = f"the object is {RISE:g} m above its initial position"
        return () if self._first is None else (RolloutEvent(self._first, "lifted", (), text),)
