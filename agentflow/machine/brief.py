"""Owns the brief: what a task asks and allows, as plain data.

Written by the tasks, read by validity (what is legal) and by the prompts (what is told), so that
neither needs to know what a task is.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from agentflow.machine.tree import ROOT, Machine

LONE_ROOT = Machine((ROOT,))
SIZE_LIMIT = (17.0, 9.5, 17.0)
"""Building volume, x, y, z in metres (spec 1.5); the limit itself is legal."""


@dataclass(frozen=True)
class Brief:
    """A task as its designers see it. Every sentence is complete and stands for itself."""

    name: str
    """Family and level, "throwing" or "throwing/3"."""
    objective: str
    """One sentence: what the machine must do."""
    scene: tuple[str, ...]
    """Sentences on ground, walls, wind and objects, with numbers in metres."""
    schedule: tuple[str, ...]
    """Sentences on what is switched on when (seconds since t = 0)."""
    score: tuple[str, ...]
    """Sentences on how the score is counted, with its unit."""
    blocks: tuple[int, ...]
    """Allowed block types, ascending."""
    required: Mapping[int, int] = field(default_factory=dict)
    """Block type -> exact number that a complete machine must have."""
    size_limit: tuple[float, float, float] = SIZE_LIMIT
    """Largest extent of the machine along x, y, z in metres."""
    given: Machine = LONE_ROOT
    """What every machine begins with, unchanged; the block list does not bind it."""
