"""A family from outside the package; its second level kills who simulates a car of 7 blocks."""

from __future__ import annotations

import os
import signal
from dataclasses import dataclass
from typing import ClassVar

from agentflow.env.scene import Scene
from agentflow.env.tasks.families.movement import Movement
from agentflow.machine.tree import Machine


@dataclass(frozen=True)
class Faulty(Movement):
    """Movement on a computer that breaks."""

    family: ClassVar[str] = "faulty"

    def scene(self, machine: Machine | None = None) -> Scene:
        if self.level == 2 and machine and len(machine) > 6:
            os.kill(os.getpid(), signal.SIGKILL)
        return super().scene(machine)
