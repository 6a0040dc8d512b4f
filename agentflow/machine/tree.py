"""Construction trees: the ordered steps that build a machine, and their JSON form."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property


@dataclass(frozen=True, slots=True)
class Step:
    """One block and what it is attached to.

    A standard block is attached to one face of one parent. A two-ended block (brace, spring, winch)
    also sets `parent_b` and `face_id_b` for its second end. The root has parent -1 and face -1.
    """

    id: int
    type: int
    parent: int
    face_id: int
    parent_b: int | None = None
    face_id_b: int | None = None

    @property
    def two_ended(self) -> bool:
        """Whether the block has two parents."""
        return self.parent_b is not None

    @property
    def attachments(self) -> tuple[tuple[int, int], ...]:
        """(block id, face id) that each end is attached to; () for the root."""
        if self.parent_b is not None and self.face_id_b is not None:
            return (self.parent, self.face_id), (self.parent_b, self.face_id_b)
        return ((self.parent, self.face_id),) if self.parent >= 0 else ()

    @property
    def parents(self) -> tuple[int, ...]:
        """Ids of the blocks it is attached to; () for the root."""
        return tuple(parent for parent, _ in self.attachments)

    def to_json(self) -> dict[str, int]:
        """The step in the JSON form that models read and write."""
        data = {"type": self.type, "id": self.id}
        if self.parent_b is None or self.face_id_b is None:
            return data | {"parent": self.parent, "face_id": self.face_id}
        return data | {
            "parent_a": self.parent,
            "face_id_a": self.face_id,
            "parent_b": self.parent_b,
            "face_id_b": self.face_id_b,
        }


ROOT = Step(id=0, type=0, parent=-1, face_id=-1)


@dataclass(frozen=True)
class Machine:
    """A file-valid construction tree: `steps[i].id == i`, and parents precede children."""

    steps: tuple[Step, ...]

    def __len__(self) -> int:
        return len(self.steps)

    def __iter__(self) -> Iterator[Step]:
        return iter(self.steps)

    def __getitem__(self, block_id: int) -> Step:
        return self.steps[block_id]

    def to_json(self) -> list[dict[str, int]]:
        """The tree as JSON data, one object per block in id order."""
        return [step.to_json() for step in self.steps]

    def to_text(self) -> str:
        """The tree as JSON text, one block per line."""
        return "[\n" + ",\n".join("  " + json.dumps(item) for item in self.to_json()) + "\n]"

    @cached_property
    def digest(self) -> str:
        """Content hash, 16 hex digits: equal trees have equal digests on every platform."""
        text = json.dumps(self.to_json(), separators=(",", ":"), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    def count(self, block_type: int) -> int:
        """Number of blocks of this type."""
        return sum(step.type == block_type for step in self.steps)


def renumber(steps: Iterable[Step]) -> tuple[Machine, dict[int, int]]:
    """Close gaps in the ids of steps; return the machine and the map from old to new ids."""
    kept = tuple(steps)
    ids = {step.id: index for index, step in enumerate(kept)}
    new = (
        Step(
            ids[step.id],
            step.type,
            ids.get(step.parent, -1),
            step.face_id,
            None if step.parent_b is None else ids[step.parent_b],
            step.face_id_b,
        )
        for step in kept
    )
    return Machine(tuple(new)), ids
