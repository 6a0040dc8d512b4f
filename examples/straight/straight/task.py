"""A task family: drive far along z+, but straight."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

from agentflow.env.rollout import Trace, Verdict
from agentflow.env.tasks.families.movement import Movement, MovementReferee
from agentflow.env.tasks.features.roads import centre_line
from agentflow.machine.brief import Brief
from agentflow.machine.tree import Machine

COST = 10.0
"""Metres that each metre of drift to the side costs."""


@dataclass(frozen=True)
class Straight(Movement):
    """Score: distance along z+ minus ten times the drift to the side, m."""

    family: ClassVar[str] = "straight"

    @property
    def brief(self) -> Brief:
        """What prompts say about it."""
        return replace(
            super().brief,
            objective="Build a machine that drives far along z+, in a straight line.",
            score=(
                "Score: the greatest distance in metres of the Starting Block along z+, minus "
                f"{COST:g} m for each metre that it ends to the side; at least 0.",
            ),
        )

    def referee(self, machine: Machine) -> StraightReferee:  # noqa: ARG002
        """What watches a simulation and scores it."""
        return StraightReferee(centre_line(self.parameters.road, self.parameters.curve))


class StraightReferee(MovementReferee):
    """Watches as the referee of movement does, and subtracts the drift."""

    def verdict(self, trace: Trace) -> Verdict:
        """The score, and the numbers that it is made of."""
        found = super().verdict(trace)
        drift = abs(float(found.terms["drift"] or 0.0))
        return replace(found, score=max(0.0, found.score - COST * drift))
