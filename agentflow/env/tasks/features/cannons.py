"""For how long each water cannon fires, as steam and cold."""

from __future__ import annotations

from math import dist

from agentflow.env.feedback.text import number
from agentflow.env.tasks.base import ROUNDING, WorldView
from agentflow.machine.blocks.library import library
from agentflow.machine.blocks.types import DIRECTIONS
from agentflow.machine.geometry.vectors import Vec3, add, rotate_vector, scale
from agentflow.machine.tree import Machine

EVERY = 0.1
"""Time between looks at what flames heat, s: until something breaks, this never changes."""
MOST = 6
"""Most texts; cannons that fired alike share one."""
LEAST = 0.05
"""Shortest time that is reported, s."""


class CannonWatch:
    """Adds up when the cannons of a machine fire."""

    def __init__(self, machine: Machine) -> None:
        kinds = [(step.id, library()[step.type]) for step in machine]
        self._entries = {
            block: block if machine.controlled else "motors"
            for block, kind in kinds
            if kind.steam is not None
        }
        """What each cannon's level is that of."""
        self._flames = [(block, kind.flame) for block, kind in kinds if kind.flame is not None]
        self._seconds = {block: [0.0, 0.0] for block in self._entries}
        """For how long each cannon fired as steam, and cold, s."""
        self._cold: dict[int, bool] = {}
        """Which cannons no flame heats, when last looked at."""
        self._time = self._due = 0.0

    def watch(self, world: WorldView) -> None:
        """Add the time since the last call."""
        passed, self._time = world.time - self._time, world.time
        if world.time >= self._due - ROUNDING:
            self._due = world.time + EVERY
            self._look(world)
        for block, entry in self._entries.items():
            if world.levels.get(entry):
                self._seconds[block][self._cold[block]] += passed

    def _look(self, world: WorldView) -> None:
        flames = [
            (_ahead(world, block, scale(DIRECTIONS[flame.direction], flame.reach)), flame.radius)
            for block, flame in self._flames
        ]
        for block in self._entries:
            middle = world.centre(block)
            self._cold[block] = all(dist(middle, at) > radius for at, radius in flames)

    @property
    def text(self) -> str:
        """What each cannon did; "" without cannons."""
        alike: dict[str, list[int]] = {}
        for block, (steam, cold) in self._seconds.items():
            alike.setdefault(_fired_text(steam, cold), []).append(block)
        texts = [f"{', '.join(map(str, blocks))} {text}" for text, blocks in alike.items()]
        hidden = sum(map(len, list(alike.values())[MOST:]))
        return "; ".join([*texts[:MOST], *([f"{hidden} more not shown"] if hidden else [])])


def _fired_text(steam: float, cold: float) -> str:
    """For how long a cannon fired, s."""
    spans = (("as steam", steam), ("cold", cold))
    told = [f"{how} {number(seconds, 1)} s" for how, seconds in spans if seconds >= LEAST]
    return ", ".join(told) or "never fired"


def _ahead(world: WorldView, block: int, offset: Vec3) -> Vec3:
    """A point that is `offset` from a block's centre, in the block's own frame."""
    return add(world.centre(block), rotate_vector(world.rotation(block), offset))
