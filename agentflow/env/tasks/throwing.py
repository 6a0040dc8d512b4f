"""Owns the throwing family: throw the boulder as far as possible along z+.

The yard, the rule that tells a throw from a boulder that is carried or rolls, the score and the
default feedback; simulation is rollout.py's.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from agentflow.env.constants import constants
from agentflow.env.feedback import block_name, compose, number, series
from agentflow.env.scene import Scene, Thing, Vec3
from agentflow.env.tasks.base import Body, Parameters, World
from agentflow.env.tasks.family import GROUND, CommonKnobs, Family, schedule_sentences, wall
from agentflow.env.tasks.knobs import knob
from agentflow.env.trace import Broken, Event, Feedback, Trace, Verdict
from agentflow.machine.blocks import BOULDER
from agentflow.machine.brief import Brief
from agentflow.machine.tree import Machine

BLOCKS = (0, 1, 2, 5, 7, 9, 15, 16, 22, 30, 35, 36, 41, 63)
FREE_FLIGHT = 0.2
"""Seconds without contact that make a flight (spec 3)."""
NEAR = 0.25
"""The root may not be within this share of the distance at the landing (spec 3)."""
RL_HEIGHT = 3.0
"""Metres that the boulder must exceed for the reinforcement-learning score (spec 3)."""
ROUNDING = 1e-6
"""Seconds by which summed steps may miss a limit."""


class Yard(Parameters):
    """The four walls around the machine."""

    distance: float = knob(11, 9, 100, "m", "distance of the walls' centres from x = z = 0")
    height: float = knob(1.5, 0, 10, "m", "height of the walls; 0 removes them")
    thickness: float = knob(0.8, 0.2, 2, "m", "thickness of the walls")


class ThrowingKnobs(CommonKnobs):
    """What can be set about a throwing level."""

    wall: Yard = Yard()
    score: Literal["distance", "rl"] = Field(
        "distance",
        description="distance, or rl: greatest height x distance",
        json_schema_extra={"unit": "distance or rl"},
    )


@dataclass(frozen=True)
class Throwing(Family):
    """Score: how far along z+ the boulder's centre is from its place at t = 0 when it lands, m.

    A throw: the boulder leaves the machine, touches nothing for at least 0.2 s, and then lands,
    which is its first touch of ground or wall. The flight must begin at the machine: once the
    boulder has touched ground or wall without that, only a new touch of the machine that lifts it
    off again can begin a flight. It counts nothing when the root's centre is then horizontally
    (x, z) nearer to the boulder's than a quarter of the distance.
    """

    family: ClassVar[str] = "throwing"
    knobs: ClassVar[type[CommonKnobs]] = ThrowingKnobs
    parameters: ThrowingKnobs

    @property
    def brief(self) -> Brief:
        """What designers are told and what validity checks."""
        knobs = self.parameters
        return Brief(
            name=self.name,
            objective="Build a machine that throws its boulder as far as possible along z+.",
            scene=(*GROUND, *_yard_sentences(knobs.wall), *knobs.wind.sentences()),
            schedule=schedule_sentences(self.schedule, self.window),
            score=(*_score_sentences(knobs.score, self.window), *_RULES),
            blocks=BLOCKS,
            required={BOULDER: 1},
        )

    def scene(self, machine: Machine | None = None) -> Scene:  # noqa: ARG002
        """Four walls, wind."""
        return Scene(_yard_walls(self.parameters.wall), self.parameters.wind.velocity)

    def referee(self, machine: Machine) -> ThrowReferee:
        """A fresh observer of the boulder."""
        return ThrowReferee(machine, self.parameters.score)

    def feedback(
        self, machine: Machine, trace: Trace, broken: tuple[Broken, ...], verdict: Verdict
    ) -> Feedback:
        """How it flew, how far and high, and the boulder's path (spec 3.2)."""
        terms = verdict.terms
        lines = (
            f"Result: {terms['result']}",
            f"Boulder: greatest horizontal distance {number(_term(verdict, 'reach'))} m, "
            f"greatest height {number(_term(verdict, 'height'))} m, "
            f"landing index {'none' if terms['landing_index'] is None else terms['landing_index']}",
        )
        boulder = _boulder(machine)
        path = series("Boulder position", trace.times, trace.centre[:, boulder])
        unit = "m" if self.parameters.score == "distance" else ""
        return compose(machine, trace, broken, verdict, unit, lines, {"boulder": boulder}, (path,))


class ThrowReferee:
    """Follows the boulder's centre and contacts step by step until it lands."""

    def __init__(self, machine: Machine, score: Literal["distance", "rl"]) -> None:
        self._machine, self._score = machine, score
        self._boulder = _boulder(machine)
        self._origin: Vec3 = (0.0, 0.0, 0.0)
        self._height = self._height_time = self._reach = 0.0
        self._holder: int | None = None
        self._left: float | None = None
        """Last moment at which the boulder touched the machine."""
        self._clean = False
        """Whether it has touched neither ground nor wall since then."""
        self._rolled = False
        self._landing: _Landing | None = None

    def start(self, world: World) -> None:
        """Remember where the boulder rests and what holds it."""
        self._origin = world.centre(self._boulder)
        self.watch(world)

    def watch(self, world: World) -> None:
        """Keep the greatest height and reach until it lands."""
        if self._landing is not None:
            return
        x, y, z = world.centre(self._boulder)
        self._reach = max(self._reach, hypot(x - self._origin[0], z - self._origin[2]))
        if y > self._height:
            self._height, self._height_time = y, world.time
        self._follow(world, world.touching(self._boulder))

    def _follow(self, world: World, touching: frozenset[Body]) -> None:
        blocks = [body for body in touching if isinstance(body, int)]
        scene = sorted(body for body in touching if isinstance(body, str))
        if blocks:
            self._holder, self._left, self._clean = min(blocks), world.time, not scene
        elif scene:
            if self._clean and world.time - (self._left or 0.0) >= FREE_FLIGHT - ROUNDING:
                self._land(world, scene[0])
            else:
                self._clean, self._rolled = False, True

    def _land(self, world: World, surface: str) -> None:
        x, _, z = world.centre(self._boulder)
        root = world.centre(0)
        self._landing = _Landing(
            time=world.time,
            surface=surface,
            forward=z - self._origin[2],
            any=hypot(x - self._origin[0], z - self._origin[2]),
            from_root=hypot(x - root[0], z - root[2]),
        )

    def verdict(self, trace: Trace) -> Verdict:  # noqa: ARG002
        """Score, terms and events; every term is always there, None where it does not apply."""
        landing = self._landing
        distance = landing.counted(landing.forward) if landing else 0.0
        rl = self._height * distance if self._height > RL_HEIGHT else 0.0
        left = self._left if landing or self._rolled else None
        terms: dict[str, float | bool | str | None] = {
            "distance": distance,
            "distance_any": landing.counted(landing.any) if landing else 0.0,
            "height": self._height,
            "height_time": self._height_time,
            "reach": self._reach,
            "rl": rl,
            "thrown": distance > 0.0,
            "left_holder": left,
            "landing": landing.time if landing else None,
            "landing_index": landing.index if landing else None,
            "landed_on": landing.surface if landing else None,
            "root_distance": landing.from_root if landing else None,
            "result": self._result(distance),
        }
        return Verdict(distance if self._score == "distance" else rl, terms, self._events(left))

    def _events(self, left: float | None) -> tuple[Event, ...]:
        if self._landing is None or self._holder is None or left is None:
            return ()
        landing, boulder = self._landing, self._boulder
        holder = block_name(self._machine, self._holder)
        ground = f"the boulder lands on the {landing.surface}"
        return (
            Event(left, "left_holder", (boulder, self._holder), f"the boulder leaves {holder}"),
            Event(landing.time, "landing", (boulder,), ground),
        )

    def _result(self, distance: float) -> str:
        landing = self._landing
        if landing is None or self._left is None or self._holder is None:
            return _FAILED[self._rolled, self._left is not None]
        flight = (
            f"the boulder left {block_name(self._machine, self._holder)} at "
            f"{number(self._left)} s and landed on the {landing.surface} at "
            f"{number(landing.time)} s"
        )
        if distance > 0.0:
            return f"thrown: {flight}, {number(distance)} m along z+"
        if landing.forward <= 0.0:
            return f"thrown the wrong way: {flight}, {number(-landing.forward)} m along z-"
        return (
            f"carried: {flight}, {number(landing.forward)} m along z+ with the Starting Block only "
            f"{number(landing.from_root)} m away"
        )


@dataclass(frozen=True)
class _Landing:
    """The first touch of ground or wall after free flight; metres and seconds."""

    time: float
    surface: str
    forward: float
    any: float
    from_root: float

    @property
    def index(self) -> int:
        """The first of the usual samples at or after the touch."""
        return int(np.ceil(self.time / constants()["sample_interval"] - ROUNDING))

    def counted(self, distance: float) -> float:
        """The distance, 0 where it is negative or the root has come along."""
        return max(0.0, distance) if self.from_root >= NEAR * distance else 0.0


_FAILED = {
    (False, False): "not thrown: the boulder never touched the machine",
    (False, True): "not thrown: the boulder never came down free of the machine",
    (True, False): "not thrown: the boulder lay on the ground and never left from the machine",
    (True, True): f"not thrown: the boulder reached the ground without {FREE_FLIGHT:g} s of free "
    "flight (carried, dropped, pushed or rolled)",
}
"""Keys: whether it rolled, whether it was ever held."""


def _boulder(machine: Machine) -> int:
    return next(step.id for step in machine if step.type == BOULDER)


def _term(verdict: Verdict, name: str) -> float:
    return float(verdict.terms[name] or 0.0)


def _yard_walls(yard: Yard) -> tuple[Thing, ...]:
    if not yard.height:
        return ()
    far, high, thick = yard.distance, yard.height, yard.thickness
    side: Vec3 = (thick, high, 2 * far + thick)
    end: Vec3 = (2 * far - thick, high, thick)
    return (
        wall("left wall", -far, 0.0, side),
        wall("right wall", far, 0.0, side),
        wall("back wall", 0.0, -far, end),
        wall("front wall", 0.0, far, end),
    )


def _yard_sentences(yard: Yard) -> tuple[str, ...]:
    if not yard.height:
        return ()
    return (
        f"Walls stand around the machine at x = -{yard.distance:g}, x = {yard.distance:g}, "
        f"z = -{yard.distance:g} and z = {yard.distance:g} m, {yard.height:g} m high and "
        f"{yard.thickness:g} m thick.",
    )


def _score_sentences(score: str, window: float) -> tuple[str, ...]:
    distance = (
        "the distance in metres along z+ from the boulder's place at t = 0 to its first touch of "
        f"ground or wall after free flight, within {window:g} s"
    )
    if score == "distance":
        return (f"Score: {distance}; at least 0.",)
    return (
        f"Score: the boulder's greatest height in metres times {distance}; 0 unless the height "
        f"exceeds {RL_HEIGHT:g} m.",
    )


_RULES = (
    "The centre of the boulder is what counts.",
    f"Free flight means no contact with the machine for {FREE_FLIGHT:g} s: a boulder that is "
    "carried, rolls, is pushed along or never leaves the machine scores 0.",
    f"The throw counts only when the Starting Block is not within {NEAR:.0%} of the distance of "
    "the boulder when it lands.",
)
