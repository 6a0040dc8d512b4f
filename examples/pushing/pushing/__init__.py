"""A task family outside the package: push a crate along z+ as far as possible."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from agentflow.env.feedback.compose import compose
from agentflow.env.rollout import Broken, Feedback, Trace, Verdict
from agentflow.env.scene import Scene, SceneObject
from agentflow.env.tasks.base import Parameters, WorldView
from agentflow.env.tasks.family import GROUND, CommonKnobs, Family
from agentflow.env.tasks.knobs import knob
from agentflow.machine.brief import Brief
from agentflow.machine.tree import Machine

CRATE = "crate"
BLOCKS = (0, 1, 2, 15, 16, 22, 35, 41, 63)


class Crate(Parameters):
    """The crate to push."""

    distance: float = knob(10, 5, 50, "m", "z of the crate's middle")
    edge: float = knob(2, 0.5, 5, "m", "length of an edge")
    mass: float = knob(3, 0.1, 500, "kg", "mass of the crate")


class PushingKnobs(CommonKnobs):
    """Knobs of a pushing level."""

    crate: Crate = Crate()


@dataclass(frozen=True)
class Pushing(Family):
    """Score: distance along z+ from the crate's position at t = 0 to its position at the end, m."""

    family: ClassVar[str] = "pushing"
    knobs: ClassVar[type[CommonKnobs]] = PushingKnobs
    parameters: PushingKnobs

    @property
    def brief(self) -> Brief:
        """Description for designers, and the constraints that validation checks."""
        crate = self.parameters.crate
        return self.describe(
            BLOCKS,
            objective="Build a machine that pushes a crate as far as possible along z+.",
            scene=(
                *GROUND,
                f"A crate of {crate.mass:g} kg with edges of {crate.edge:g} m stands with its "
                f"middle at z = {crate.distance:g} m.",
                *self.parameters.wind.sentences(),
            ),
            score=(
                "Score: the distance in metres along z+ from the position of the crate's centre at "
                "t = 0 to its position at the end of the window; at least 0.",
            ),
        )

    def scene(self, machine: Machine | None = None) -> Scene:  # noqa: ARG002
        """The crate."""
        crate = self.parameters.crate
        size = (crate.edge, crate.edge, crate.edge)
        middle = (0.0, crate.edge / 2, crate.distance)
        return Scene(
            (SceneObject(CRATE, "box", size, middle, mass=crate.mass),),
            self.parameters.wind.velocity,
        )

    def referee(self, machine: Machine) -> PushingReferee:  # noqa: ARG002
        """A new referee that observes the crate."""
        return PushingReferee()

    def feedback(
        self, machine: Machine, trace: Trace, broken: tuple[Broken, ...], verdict: Verdict
    ) -> Feedback:
        """Distance that the crate moved."""
        line = f"Crate: {verdict.terms['pushed']:.2f} m towards z+"
        return compose(machine, trace, broken, verdict, "m", (line,), {}, ())


class PushingReferee:
    """Tracks the crate's centre step by step."""

    def start(self, world: WorldView) -> None:
        """Record where the crate rests."""
        self._start = self._end = world.centre(CRATE)[2]

    def watch(self, world: WorldView) -> None:
        """Record where the crate is now."""
        self._end = world.centre(CRATE)[2]

    def verdict(self, trace: Trace) -> Verdict:  # noqa: ARG002
        """Score and its only term."""
        pushed = self._end - self._start
        return Verdict(max(0.0, pushed), {"pushed": pushed})
