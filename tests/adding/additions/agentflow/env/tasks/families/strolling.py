"""Movement with another objective."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

from agentflow.env.tasks.families.movement import Movement
from agentflow.env.tasks.family import sentences
from agentflow.machine.brief import Brief


@dataclass(frozen=True)
class Strolling(Movement):
    """A machine that strolls along z+."""

    family: ClassVar[str] = "strolling"

    @property
    def brief(self) -> Brief:
        [objective] = sentences("strolling")["objective"]
        return replace(super().brief, objective=objective)
