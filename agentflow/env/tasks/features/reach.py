"""Owns how far blocks reach in a running world: the lowest point of a turned box."""

from __future__ import annotations

from agentflow.env.physics.vectors import turned
from agentflow.env.tasks.base import World
from agentflow.machine.blocks.library import library
from agentflow.machine.tree import Machine


def lowest_point(world: World, machine: Machine, block: int) -> float:
    """Height of the lowest corner of a block's box, m; of a two-ended block its centre's."""
    size = library()[machine[block].type].size
    height = world.centre(block)[1]
    if size is None:
        return height
    x, y, z, w = world.rotation(block)
    down = turned((-x, -y, -z, w), (0.0, 1.0, 0.0))
    return height - sum(abs(axis) * side / 2 for axis, side in zip(down, size, strict=True))
