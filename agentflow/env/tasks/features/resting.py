"""Where machines and objects are set down: machines on a scene, objects on a machine."""

from __future__ import annotations

from collections.abc import Sequence

from agentflow.env.scene import SceneObject
from agentflow.machine.geometry.placement import place
from agentflow.machine.tree import Machine

BESIDE = 1e-6
"""What overlaps by less only touches, m."""


def highest_point_under(machine: Machine, x: float, z: float, reach: float) -> float:
    """Height of the highest point of a machine on the ground within a horizontal square, m.

    Args:
        machine: The machine; the centre of its bounding box is over x = z = 0.
        x: x of the square's middle, m.
        z: z of the square's middle, m.
        reach: Half of the square's side, m.
    """
    geometry = place(machine)
    low, high = geometry.box_min, geometry.box_max
    middle_x, middle_z = (low[0] + high[0]) / 2 + x, (low[2] + high[2]) / 2 + z
    tops = [
        block.box_max[1] - low[1]
        for block in geometry.blocks
        if not block.two_ended
        and block.box_min[0] < middle_x + reach
        and block.box_max[0] > middle_x - reach
        and block.box_min[2] < middle_z + reach
        and block.box_max[2] > middle_z - reach
    ]
    return max(tops, default=0.0)


def lowest_place(machine: Machine, banks: Sequence[SceneObject]) -> float:
    """How low a machine can be set down, as the height of its lowest point, m.

    Args:
        machine: The machine; the centre of its bounding box is over x = z = 0.
        banks: Boxes along the axes that it must not overlap, nor the ground at y = 0.
    """
    geometry = place(machine)
    low, high = geometry.box_min, geometry.box_max
    middle = tuple((a + b) / 2 for a, b in zip(low, high, strict=True))

    def over(block_low: Sequence[float], block_high: Sequence[float], bank: SceneObject) -> bool:
        return all(
            block_low[axis] - middle[axis] < bank.position[axis] + bank.size[axis] / 2 - BESIDE
            and block_high[axis] - middle[axis] > bank.position[axis] - bank.size[axis] / 2 + BESIDE
            for axis in (0, 2)
        )

    lifts = [
        bank.position[1] + bank.size[1] / 2 - (block.box_min[1] - low[1])
        for block in geometry.blocks
        for bank in banks
        if not block.two_ended and over(block.box_min, block.box_max, bank)
    ]
    return max(0.0, *lifts) if lifts else 0.0
