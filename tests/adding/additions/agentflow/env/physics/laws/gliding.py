"""Kites, which their motion along z lifts."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

from agentflow.env.physics.laws.motion import MotionDevice
from agentflow.machine.blocks.types import BlockType
from agentflow.machine.geometry.pose import Placed
from agentflow.machine.geometry.vectors import Vec3


@dataclass(frozen=True)
class Kite(MotionDevice):
    """A sheet that pulls sideways, however it moves."""

    loss: ClassVar[str] = "the pull of kites"
    newtons: float

    @classmethod
    def of(cls, block: Placed, kind: BlockType, part: int) -> Kite | None:  # noqa: ARG003
        return None if kind.kite is None else cls(part, kind.kite)

    def scaled(self, factor: float) -> Kite:
        return replace(self, newtons=self.newtons * factor)

    def push(self, velocity: Vec3) -> Vec3:  # noqa: ARG002
        return (self.newtons, 0.0, 0.0)
