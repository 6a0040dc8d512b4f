"""Briefs: what a task asks and allows, as plain data.

Tasks write them; validity checks and prompts read them without knowing about tasks.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

from agentflow.machine.geometry.placement import Bank, Geometry
from agentflow.machine.requirements import NONE, Judged, Requirements
from agentflow.machine.tree import ROOT, Machine

LONE_ROOT = Machine((ROOT,))
SIZE_LIMIT = (17.0, 9.5, 17.0)
"""Building volume, x, y, z in metres, inclusive."""


@dataclass(frozen=True)
class Limits:
    """How large a machine may be, and whether it may control itself."""

    size: tuple[float, float, float] = SIZE_LIMIT
    """Maximum extent along x, y, z in metres."""
    blocks: int | None = None
    """Most blocks, as `Brief.count_blocks` counts them; None: any number."""
    parts: int | None = None
    """Most parts in one piece that the physics engine can hold; None: any number."""
    engine: str = field(default="the physics engine", repr=False)
    """Name of the engine, for messages about its parts; the digest of a brief leaves it out."""
    controls: float | None = field(default=None, repr=False)
    """Latest end of a machine's own controls, in seconds since t = 0; None: it may have none. The
    digest of a brief leaves it out, as its schedule says the same."""
    senses: bool = field(default=False, repr=False)
    trials: int = field(default=1, repr=False)
    """Rollouts of a design: after each but the last, its controls alone may be revised, and the
    best one counts."""


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
    limits: Limits = Limits()
    given: Machine = LONE_ROOT
    """The unchanged beginning of every machine; may use types that `blocks` does not allow."""
    greatest: float | None = None
    """The greatest possible score; None if there is none. It ends a search."""
    banks: tuple[Bank, ...] = field(default=(), repr=False)
    """What machines are set down on, if it is not the ground; the digest of a brief leaves it out,
    as its scene says the same."""

    requirements: Requirements = field(default=NONE, repr=False)
    """What machines must keep besides; the digest of a brief leaves it out, as its score says the
    same."""

    @property
    def wording(self) -> str:
        """All fields but those that came later, in words; digests in recorded runs are made of
        it, so it stays as it is."""
        return repr(self).replace(repr(self.given), self.given.wording)

    symmetric: bool = field(default=False, repr=False)
    """Whether neither scene nor score tells left from right, so that a machine and its mirror image
    do the same. The digest of a brief leaves it out, as its scene says the same."""

    wishes: str = field(default="", repr=False)
    """What the user asks of the machine besides, in their own words; no part of the digest."""
    sketch: tuple[str, ...] = field(default=(), repr=False)
    """PNG data URL of the user's sketch, if there is one; no part of the digest."""

    @property
    def demands(self) -> tuple[object, ...]:
        """What decides whether a machine is valid for the task."""
        return self.blocks, self.required, self.limits, self.given

    @property
    def uncounted(self) -> int:
        """Number of given blocks that do not count: a lone root counts, a given structure not."""
        return 0 if self.given == LONE_ROOT else len(self.given)

    def count_blocks(self, total: int) -> int:
        """Blocks of a machine that count, of `total` blocks."""
        return total - self.uncounted

    def judge(self, geometry: Geometry) -> tuple[Judged, ...]:
        """The requirements that need no simulation, of a machine with this geometry."""
        return self.requirements.judge(geometry, self.uncounted)

    def budget_json(self, machine: Machine | None) -> dict[str, int | None]:
        """`blocks` of a machine that count and `most_blocks`, None for what there is not."""
        count = None if machine is None else self.count_blocks(len(machine))
        return {"blocks": count, "most_blocks": self.limits.blocks}

    @property
    def most_blocks(self) -> str:
        """The most blocks of a machine in words; "" if there is no limit."""
        if self.limits.blocks is None:
            return ""
        noun = "block" if self.limits.blocks == 1 else "blocks"
        given = f"besides the {self.uncounted} given" if self.uncounted else "root included"
        return f"{self.limits.blocks} {noun} ({given})"
