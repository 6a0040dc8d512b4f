"""The throwing family: throw the boulder far along z+, through rings or at a target."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import inf
from typing import Any, ClassVar, Literal

from agentflow.env.feedback.compose import compose
from agentflow.env.feedback.separation import describe_release
from agentflow.env.feedback.text import block_name, number, series, term_number
from agentflow.env.rollout import Broken, Feedback, Trace, Verdict
from agentflow.env.scene import Scene
from agentflow.env.tasks.base import Descriptor, Parameters, WorldView, release_height, share_of
from agentflow.env.tasks.family import CommonKnobs, Family
from agentflow.env.tasks.features.arena import Arena, Hurdle, Ramps, arena_objects
from agentflow.env.tasks.features.flights import FREE_FLIGHT, NEAR, RL_HEIGHT, Flight
from agentflow.env.tasks.features.platforms import SIDE, Platform
from agentflow.env.tasks.features.rings import EACH, THICK, Ring, ring_objects
from agentflow.env.tasks.knobs import choice, knob
from agentflow.machine.blocks.library import BOULDER
from agentflow.machine.brief import Brief
from agentflow.machine.tree import Machine
from agentflow.search.elites.axes import Axis

BLOCKS = (0, 1, 2, 5, 7, 9, 15, 16, 22, 30, 35, 36, 41, 63)
TARGET_POINTS, TARGET_COST = 10.0, 0.5
"""Points for landing on the target, and points lost per metre from it."""
AFTER = 0.5
"""How long after its landing the boulder's path is reported, s."""
Mode = Literal["distance", "rl", "rings", "accuracy"]


class Rings(Parameters):
    """A row of upright rings, for `score: rings`."""

    count: int = knob(0, 0, 5, "", "number of rings")
    first: float = knob(18, 12, 100, "m", "z of the first ring's centre")
    spacing: float = knob(8, 2, 50, "m", "distance between rings")
    height: float = knob(7, 5, 30, "m", "height of their centres")
    radius: float = knob(4, 1, 10, "m", "inner radius")


class Target(Parameters):
    """A point on the ground, for `score: accuracy`."""

    at: float = knob(20, 12, 100, "m", "z of the target; its x is 0")


class ThrowingKnobs(CommonKnobs):
    """Knobs of a throwing level."""

    wall: Arena = Arena()
    ramp: Ramps = Ramps()
    platform: Platform = Platform()
    obstacle: Hurdle = Hurdle()
    ring: Rings = Rings()
    target: Target = Target()
    reload: int = knob(1, 1, 4, "", "number of boulders; the score is the mean of their scores")
    score: Mode = choice(
        "distance",
        "distance, rl, rings or accuracy",
        "distance; rl (reward for RL training): greatest height x distance; rings: 10 per ring "
        "passed; accuracy: up to 10 for landing close to the target",
    )

    @property
    def rings(self) -> tuple[Ring, ...]:
        """The rings in order."""
        ring = self.ring
        return tuple(
            Ring((0.0, ring.height, ring.first + index * ring.spacing), ring.radius)
            for index in range(ring.count)
        )


@dataclass(frozen=True)
class Throwing(Family):
    """Score: distance of the boulder's centre along z+ from its position at t = 0 to its landing,
    m. A boulder still in free flight at the end of the window counts with its distance by then.

    Other modes score 10 for each ring passed in order and up to 10 for coming close to the next
    one, or up to 10 for landing close to a target. Without a throw (see `flights.Flight`) the
    score is 0. With several boulders it is their mean.
    """

    family: ClassVar[str] = "throwing"
    knobs: ClassVar[type[CommonKnobs]] = ThrowingKnobs
    performance: ClassVar[str] = "rl"
    ranked: ClassVar[bool] = True
    symmetric: ClassVar[bool] = True
    diagnosed: ClassVar[bool] = True
    descriptors: ClassVar[tuple[Descriptor, ...]] = (
        # falling weight does the rest of the work, so most cells of high shares of both stay empty
        Descriptor(Axis("share of the work done by springs", "", 0.0, 1.0, 4), share_of("springs")),
        Descriptor(Axis("share of the work done by motors", "", 0.0, 1.0, 4), share_of("motors")),
        Descriptor(Axis("release height", "m", 0.0, 12.0, 6), release_height),
    )
    parameters: ThrowingKnobs

    @property
    def unit(self) -> str:
        """As in `Task`."""
        return "m" if self.parameters.score == "distance" else ""

    @property
    def brief(self) -> Brief:
        knobs = self.parameters
        brief = self.tell(
            "throwing",
            BLOCKS,
            side=SIDE,
            thick=THICK,
            height=RL_HEIGHT,
            free=FREE_FLIGHT,
            near=NEAR,
        )
        return replace(brief, required={BOULDER: knobs.reload}, greatest=_greatest(knobs))

    def scene(self, machine: Machine | None = None) -> Scene:  # noqa: ARG002
        """Arena, platform, rings and wind."""
        knobs = self.parameters
        objects = (
            *arena_objects(knobs.wall, knobs.ramp, knobs.obstacle),
            *knobs.platform.objects(),
            *ring_objects(knobs.rings, "ring"),
        )
        return Scene(objects, knobs.wind.velocity, start=knobs.platform.start)

    def referee(self, machine: Machine) -> ThrowReferee:
        return ThrowReferee(machine, self.parameters)

    def feedback(
        self, machine: Machine, trace: Trace, broken: tuple[Broken, ...], verdict: Verdict
    ) -> Feedback:
        """Result, distance, height and path of the boulder."""
        terms = verdict.terms
        boulder = int(term_number(terms, "boulder")) or _boulders(machine)[0]
        velocity = trace.velocity[:, boulder]
        release, data = describe_release(machine, trace, verdict.moment, velocity)
        lines = (
            f"Result: {terms['result']}",
            f"Boulder: greatest height {number(term_number(terms, 'height'))} m at "
            f"{number(term_number(terms, 'height_time'))} s, greatest horizontal distance "
            f"{number(term_number(terms, 'reach'))} m",
            *_mode_lines(machine, terms),
            *release,
        )
        data["boulder"] = boulder
        even, landing = trace.even, terms["landing"]
        told = even[even.times < AFTER + (inf if landing is None else float(landing))]
        path = series("Boulder position", told.times, told.centre[:, boulder])
        return compose(machine, trace, broken, verdict, self.unit, lines, data, (path,))


class ThrowReferee:
    """Tracks every boulder and scores its flight."""

    def __init__(self, machine: Machine, knobs: ThrowingKnobs) -> None:
        self._knobs = knobs
        self._flights = [Flight(machine, block, knobs.rings) for block in _boulders(machine)]

    def start(self, world: WorldView) -> None:
        """Record where the boulders rest and what holds them."""
        for flight in self._flights:
            flight.start(world)

    def watch(self, world: WorldView) -> None:
        """Update every flight."""
        for flight in self._flights:
            flight.watch(world)

    def verdict(self, trace: Trace) -> Verdict:  # noqa: ARG002
        """Score, terms and events; the terms are those of the boulder with the best score."""
        for flight in self._flights:
            flight.finish()
        scores = [self._score(flight) for flight in self._flights]
        best = self._flights[scores.index(max(scores))]
        terms = best.terms()
        if self._knobs.score == "rings":
            progress = best.progress
            done = progress.passed == self._knobs.ring.count
            terms["passed"] = float(progress.passed)
            terms["rings"] = float(self._knobs.ring.count)
            terms["closest"] = None if done else progress.closest
        elif self._knobs.score == "accuracy":
            terms["target_distance"] = best.distance_from(0.0, self._knobs.target.at)
        if len(scores) > 1:
            thrown = sum(flight.distance > 0.0 for flight in self._flights)
            terms["boulder"] = best.boulder
            terms["throws"] = f"{thrown} of {len(scores)}"
        events = tuple(event for flight in self._flights for event in flight.events())
        return Verdict(sum(scores) / len(scores), terms, events, best.release)

    def _score(self, flight: Flight) -> float:
        mode = self._knobs.score
        if mode == "rings":
            return flight.progress.score if flight.distance else 0.0
        if mode == "accuracy":
            miss = flight.distance_from(0.0, self._knobs.target.at)
            return 0.0 if miss is None else max(0.0, TARGET_POINTS - TARGET_COST * miss)
        return term_number(flight.terms(), mode)


def _boulders(machine: Machine) -> list[int]:
    return [step.id for step in machine if step.type == BOULDER]


def _greatest(knobs: ThrowingKnobs) -> float | None:
    """The greatest possible score of the mode; None for distances, which have none."""
    if knobs.score == "rings":
        return EACH * knobs.ring.count or None
    return TARGET_POINTS if knobs.score == "accuracy" else None


def _mode_lines(machine: Machine, terms: Mapping[str, Any]) -> list[str]:
    """Feedback lines about rings, target and further boulders, where a level has them."""
    lines = []
    if "passed" in terms:
        line = f"Rings: passed {terms['passed']:g} of {terms['rings']:g}"
        if terms["closest"] is not None:
            line += f", closest distance to the next ring's centre {number(terms['closest'])} m"
        lines.append(line)
    if "target_distance" in terms:
        miss = terms["target_distance"]
        landed = "no throw landed" if miss is None else f"landed {number(miss)} m from it"
        lines.append(f"Target: {landed}")
    if "throws" in terms:
        name = block_name(machine, int(terms["boulder"]))
        lines.append(f"Boulders: {terms['throws']} thrown, the best is {name}")
    return lines
