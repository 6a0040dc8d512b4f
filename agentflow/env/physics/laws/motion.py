"""Devices that push their part as it moves, and the law that applies their pushes.

On plain floats: machines have few of them, and arrays only pay for many.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from agentflow.env.physics.laws.forces import PartForce, PartLocations
from agentflow.env.physics.rows import Row
from agentflow.machine.blocks.types import BlockType
from agentflow.machine.geometry.pose import Placed
from agentflow.machine.geometry.vectors import Vec3, rotate_vector


@dataclass(frozen=True)
class MotionDevice(ABC):
    """A device whose push depends on nothing but how its part moves.

    All vectors are in the part's own axes, in the engine's order of them.
    """

    part: int
    loss: ClassVar[str]
    """What files of other simulators lose without it, such as "the lift of blades"."""

    @classmethod
    @abstractmethod
    def of(cls, block: Placed, kind: BlockType, part: int) -> MotionDevice | None:
        """The device of a block whose part has this index; None if blocks of its kind have none."""

    @abstractmethod
    def scaled(self, factor: float) -> MotionDevice:
        """The device whose pushes are those of this one times a factor."""

    @abstractmethod
    def push(self, velocity: Vec3) -> Vec3:
        """Force at the part's centre, N, for its velocity over the ground, m/s."""


class MotionForce:
    """The pushes of such devices."""

    def __init__(self, devices: Sequence[MotionDevice], locations: PartLocations) -> None:
        self._devices: dict[int, list[tuple[MotionDevice, Vec3]]] = {}
        """Row -> devices and their offsets in the cluster, as those of one share its motion."""
        for device in devices:
            row, offset = locations.locate(device.part)
            self._devices.setdefault(row, []).append((device, offset))

    def __call__(self, rows: Sequence[Row]) -> list[PartForce]:
        """Forces in this step."""
        pushes: list[PartForce] = []
        for row, devices in self._devices.items():
            _, _, _, x, y, z, w, vx, vy, vz, wx, wy, wz = rows[row]
            to_local = (-x, -y, -z, w)
            wx, wy, wz = rotate_vector(to_local, (wx, wy, wz))
            vx, vy, vz = rotate_vector(to_local, (vx, vy, vz))
            for device, (x, y, z) in devices:
                velocity = vx + (wy * z - wz * y), vy + (wz * x - wx * z), vz + (wx * y - wy * x)
                pushes.append((device.part, device.push(velocity), None))
        return pushes
