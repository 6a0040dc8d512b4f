"""Owns the throwing family: throw the boulder along z+, far, through rings or at a target.

The score and the default feedback; what a flight is, is flights.py's, what stands around is
yard.py's, simulation is rollout.py's.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

from pydantic import Field

from agentflow.env.feedback import block_name, compose, number, series
from agentflow.env.rollout import Broken, Feedback, Trace, Verdict
from agentflow.env.scene import Scene
from agentflow.env.tasks.base import Parameters, World
from agentflow.env.tasks.family import GROUND, CommonKnobs, Family, schedule_sentences
from agentflow.env.tasks.features.flights import RL_HEIGHT, RULES, Flight
from agentflow.env.tasks.features.platforms import Platform
from agentflow.env.tasks.features.rings import Ring
from agentflow.env.tasks.features.yard import Hurdle, Ramps, Yard, yard_sentences, yard_things
from agentflow.env.tasks.knobs import knob
from agentflow.machine.blocks.library import BOULDER
from agentflow.machine.brief import Brief
from agentflow.machine.tree import Machine

BLOCKS = (0, 1, 2, 5, 7, 9, 15, 16, 22, 30, 35, 36, 41, 63)
TARGET_POINTS, TARGET_COST = 10.0, 0.5
"""Points of a throw that lands on the target, and what each metre beside it takes: as for rings."""
Mode = Literal["distance", "rl", "rings", "accuracy"]


class Rings(Parameters):
    """Upright rings, one behind the other; with `score: rings`."""

    count: int = knob(0, 0, 5, "", "how many there are")
    first: float = knob(18, 12, 100, "m", "z of the first ring's centre")
    spacing: float = knob(8, 2, 50, "m", "from one ring to the next")
    height: float = knob(7, 5, 30, "m", "height of their centres")
    radius: float = knob(4, 1, 10, "m", "radius of the opening")


class Target(Parameters):
    """A place on the ground; with `score: accuracy`."""

    at: float = knob(20, 12, 100, "m", "z of the target; its x is 0")


class ThrowingKnobs(CommonKnobs):
    """What can be set about a throwing level."""

    wall: Yard = Yard()
    ramp: Ramps = Ramps()
    platform: Platform = Platform()
    obstacle: Hurdle = Hurdle()
    ring: Rings = Rings()
    target: Target = Target()
    reload: int = knob(1, 1, 4, "", "boulders that the machine has; the score is their mean")
    score: Mode = Field(
        "distance",
        description="distance; rl: greatest height x distance; rings: 10 for each ring passed; "
        "accuracy: at most 10, for landing on the target",
        json_schema_extra={"unit": "distance, rl, rings or accuracy"},
    )

    @property
    def rings(self) -> tuple[Ring, ...]:
        """Where the rings stand."""
        ring = self.ring
        return tuple(
            Ring((0.0, ring.height, ring.first + index * ring.spacing), ring.radius)
            for index in range(ring.count)
        )


@dataclass(frozen=True)
class Throwing(Family):
    """Score: how far along z+ the boulder's centre is from its place at t = 0 when it lands, m.

    Or 10 for each ring that it passes before it lands, in order, and up to 10 for coming close to
    the next one; or up to 10 for landing close to a target. Without a throw (`flights.Flight`)
    each of them is 0. With several boulders the score is the mean over them.
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
            objective=_objective(knobs),
            scene=(
                *GROUND,
                *knobs.platform.sentences(),
                *yard_sentences(knobs.wall, knobs.ramp, knobs.obstacle),
                *_ring_sentences(knobs.ring),
                *knobs.wind.sentences(),
            ),
            schedule=schedule_sentences(self.schedule, self.window, BLOCKS),
            score=(*_SCORES[knobs.score](knobs, self.window), *_reloads(knobs.reload), *RULES),
            blocks=BLOCKS,
            required={BOULDER: knobs.reload},
        )

    def scene(self, machine: Machine | None = None) -> Scene:  # noqa: ARG002
        """What stands around the machine and under it, rings, wind."""
        knobs = self.parameters
        things = [
            *yard_things(knobs.wall, knobs.ramp, knobs.obstacle),
            *knobs.platform.things(),
        ]
        for index, ring in enumerate(knobs.rings, start=1):
            things += ring.things(f"ring {index}")
        return Scene(tuple(things), knobs.wind.velocity, start=knobs.platform.start)

    def referee(self, machine: Machine) -> ThrowReferee:
        """A fresh observer of the boulders."""
        return ThrowReferee(machine, self.parameters)

    def feedback(
        self, machine: Machine, trace: Trace, broken: tuple[Broken, ...], verdict: Verdict
    ) -> Feedback:
        """How it flew, how far and high, and the boulder's path (spec 3.2)."""
        terms = verdict.terms
        boulder = int(_number(terms, "boulder")) or _boulders(machine)[0]
        lines = (
            f"Result: {terms['result']}",
            f"Boulder: greatest horizontal distance {number(_number(terms, 'reach'))} m, "
            f"greatest height {number(_number(terms, 'height'))} m, "
            f"landing index {'none' if terms['landing_index'] is None else terms['landing_index']}",
            *_more(machine, terms),
        )
        path = series("Boulder position", trace.times, trace.centre[:, boulder])
        unit = "m" if self.parameters.score == "distance" else ""
        return compose(machine, trace, broken, verdict, unit, lines, {"boulder": boulder}, (path,))


class ThrowReferee:
    """Follows every boulder and says what its flight is worth."""

    def __init__(self, machine: Machine, knobs: ThrowingKnobs) -> None:
        self._knobs = knobs
        self._flights = [Flight(machine, block, knobs.rings) for block in _boulders(machine)]

    def start(self, world: World) -> None:
        """Remember where the boulders rest and what holds them."""
        for flight in self._flights:
            flight.start(world)

    def watch(self, world: World) -> None:
        """Keep what each does until it lands."""
        for flight in self._flights:
            flight.watch(world)

    def verdict(self, trace: Trace) -> Verdict:  # noqa: ARG002
        """Score, terms and events; the terms are those of the boulder that was worth most."""
        worth = [self._worth(flight) for flight in self._flights]
        best = self._flights[worth.index(max(worth))]
        terms = best.terms()
        if self._knobs.score == "rings":
            passage = best.passage
            done = passage.passed == self._knobs.ring.count
            terms["passed"] = float(passage.passed)
            terms["rings"] = float(self._knobs.ring.count)
            terms["closest"] = None if done else passage.closest
        elif self._knobs.score == "accuracy":
            terms["target_distance"] = best.away(0.0, self._knobs.target.at)
        if len(worth) > 1:
            thrown = sum(flight.distance > 0.0 for flight in self._flights)
            terms["boulder"] = best.boulder
            terms["throws"] = f"{thrown} of {len(worth)}"
        events = tuple(event for flight in self._flights for event in flight.events())
        return Verdict(sum(worth) / len(worth), terms, events)

    def _worth(self, flight: Flight) -> float:
        mode = self._knobs.score
        if mode == "rings":
            return flight.passage.score if flight.distance else 0.0
        if mode == "accuracy":
            away = flight.away(0.0, self._knobs.target.at)
            return 0.0 if away is None else max(0.0, TARGET_POINTS - TARGET_COST * away)
        return _number(flight.terms(), mode)


def _boulders(machine: Machine) -> list[int]:
    return [step.id for step in machine if step.type == BOULDER]


def _number(terms: Mapping[str, Any], name: str) -> float:
    return float(terms.get(name) or 0.0)


def _more(machine: Machine, terms: Mapping[str, Any]) -> list[str]:
    """Lines that only some levels have."""
    lines = []
    if "passed" in terms:
        closest = terms["closest"]
        near = (
            ""
            if closest is None
            else (f", closest distance to the next ring's centre {number(closest)} m")
        )
        lines.append(f"Rings: passed {terms['passed']:g} of {terms['rings']:g}{near}")
    if "target_distance" in terms:
        away = terms["target_distance"]
        landed = "no throw landed" if away is None else f"landed {number(away)} m from it"
        lines.append(f"Target: {landed}")
    if "throws" in terms:
        name = block_name(machine, int(terms["boulder"]))
        lines.append(f"Boulders: {terms['throws']} thrown, the best is {name}")
    return lines


def _objective(knobs: ThrowingKnobs) -> str:
    boulder = "its boulder" if knobs.reload == 1 else f"its {knobs.reload} boulders"
    aims = {
        "rings": f"through {'the ring' if knobs.ring.count == 1 else 'the rings'} along z+",
        "accuracy": "along z+ on to a target",
    }
    aim = aims.get(knobs.score, "as far as possible along z+")
    return f"Build a machine that throws {boulder} {aim}."


def _ring_sentences(ring: Rings) -> tuple[str, ...]:
    places = [f"{ring.first + index * ring.spacing:g}" for index in range(ring.count)]
    return tuple(
        f"An upright ring of inner radius {ring.radius:g} m stands across z+ with its centre at "
        f"x = 0, y = {ring.height:g}, z = {place} m."
        for place in places
    )


def _distance(window: float) -> str:
    return (
        "the distance in metres along z+ from the boulder's place at t = 0 to its first touch of "
        f"ground or wall after free flight, within {window:g} s"
    )


_SCORES: Mapping[Mode, Callable[[ThrowingKnobs, float], tuple[str, ...]]] = {
    "distance": lambda _, window: (f"Score: {_distance(window)}; at least 0.",),
    "rl": lambda _, window: (
        f"Score: the boulder's greatest height in metres times {_distance(window)}; 0 unless the "
        f"height exceeds {RL_HEIGHT:g} m.",
    ),
    "rings": lambda _, window: (
        "Score: 10 for each ring that the boulder's centre passes towards z+ in free flight, in "
        "order, plus 10 minus half its closest distance in metres to the next ring's centre, at "
        f"least 0; within {window:g} s.",
        "The flight ends with its first touch of ground, wall or ring.",
    ),
    "accuracy": lambda knobs, window: (
        "Score: 10 minus half the distance in metres between the target on the ground, at x = 0, "
        f"z = {knobs.target.at:g} m, and the boulder's first touch of ground or wall after free "
        f"flight, within {window:g} s; at least 0.",
    ),
}


def _reloads(count: int) -> tuple[str, ...]:
    if count == 1:
        return ()
    return (f"There are {count} boulders; the score is the mean of what each of them is worth.",)
