"""Briefs: what a task asks and allows, as plain data.

Tasks write them; validity checks and prompts read them without knowing about tasks.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from agentflow.machine.tree import ROOT, Machine

LONE_ROOT = Machine((ROOT,))
SIZE_LIMIT = (17.0, 9.5, 17.0)
"""Building volume, x, y, z in metres, inclusive."""


@dataclass(frozen=True)
class Brief:
    """A task as its designers see it. Sentences are complete and self-contained."""

    name: str
    """Family, or family and level: "throwing" or "throwing/3"."""
    objective: str
    """One sentence: what the machine must do."""
    scene: tuple[str, ...]
    """Sentences about ground, walls, wind and objects, in metres."""
    schedule: tuple[str, ...]
    """Sentences about what is switched on when, in seconds since t = 0."""
    score: tuple[str, ...]
    """Sentences about how the score is computed, with its unit."""
    blocks: tuple[int, ...]
    """Allowed block types, ascending."""
    required: Mapping[int, int] = field(default_factory=dict)
    """Block type -> exact number of such blocks in a complete machine."""
    size_limit: tuple[float, float, float] = SIZE_LIMIT
    """Maximum extent of the machine along x, y, z in metres."""
    given: Machine = LONE_ROOT
    """The unchanged beginning of every machine; may use types that `blocks` does not allow."""
