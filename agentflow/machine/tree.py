"""Machines: the ordered steps that build one, what controls it, and their JSON form."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from agentflow.machine.blocks.types import Group

if TYPE_CHECKING:
    from agentflow.machine.controllers.model import Controllers


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


@dataclass(frozen=True, slots=True)
class Control:
    """One entry of a control program: drives some blocks at a level for some time."""

    target: tuple[int, ...] | Group
    """Ids of blocks, or a group: every block of the machine that belongs to it."""
    at: float
    """When it begins, in seconds since t = 0."""
    lasts: float
    """For how long it holds, s."""
    level: float
    """Share of the full speed, thrust or pull, from -1 (backwards) to 1."""

    def to_json(self) -> dict[str, object]:
        """The entry in the JSON form that models read and write."""
        blocks = isinstance(self.target, tuple)
        return {
            **({"blocks": list(self.target)} if blocks else {"group": self.target}),
            "at": shorten(self.at),
            "for": shorten(self.lasts),
            "level": shorten(self.level),
        }


def shorten(number: float) -> float:
    """A number as it is written: 2 in place of 2.0."""
    return int(number) if number == int(number) else number


ROOT = Step(id=0, type=0, parent=-1, face_id=-1)


@dataclass(frozen=True)
class Machine:
    """A file-valid construction tree: `steps[i].id == i`, and parents precede children.

    Its length, items and iteration are those of its steps.
    """

    steps: tuple[Step, ...] = (ROOT,)
    """One step for each block, in order of id; a lone root by default."""
    controls: tuple[Control, ...] = ()
    """Its own control program; without one or controllers, the task's schedule drives it."""
    controllers: Controllers | None = field(default=None, hash=False)
    """What it senses, and which blocks follow it; the control program drives the others."""

    def __eq__(self, other: object) -> bool:
        """Whether the trees and what controls them are the same, whatever is known about them."""
        if not isinstance(other, Machine):
            return NotImplemented
        own = self.steps, self.controls, self.controllers
        return own == (other.steps, other.controls, other.controllers)

    def __len__(self) -> int:
        return len(self.steps)

    def __iter__(self) -> Iterator[Step]:
        return iter(self.steps)

    def __getitem__(self, block_id: int) -> Step:
        return self.steps[block_id]

    def __repr__(self) -> str:
        controls = f", {len(self.controls)} controls" if self.controls else ""
        laws = f", {len(self.controllers.laws)} laws" if self.controllers else ""
        return f"<Machine {self.digest}: {len(self)} blocks{controls}{laws}>"

    @property
    def controlled(self) -> bool:
        """Whether it brings what drives it, in place of the task's schedule."""
        return bool(self.controls or self.controllers)

    @property
    def wording(self) -> str:
        """All steps and controls in words; digests of briefs are made of it, so it stays as it
        is."""
        controls = f", controls={self.controls!r}" if self.controls else ""
        laws = f", controllers={self.controllers.to_json()!r}" if self.controllers else ""
        return f"Machine(steps={self.steps!r}{controls}{laws})"

    def to_json(self) -> MachineJson:
        """The machine as JSON data: a list with one object per block, in id order; with controls
        or controllers, an object with `blocks` and `controls`, `controllers`."""
        data: MachineJson = with_controls([step.to_json() for step in self.steps], self)
        return data

    def to_text(self) -> str:
        """The machine as JSON text, one block or control per line."""
        return lines_of(self.to_json())

    @cached_property
    def digest(self) -> str:
        """Content hash, 16 hex digits: equal trees have equal digests on every platform."""
        text = json.dumps(self.to_json(), separators=(",", ":"), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    def count(self, block_type: int) -> int:
        """Number of blocks of this type."""
        return sum(step.type == block_type for step in self.steps)

    @classmethod
    def from_json(cls, source: str | MachineJson) -> Machine:
        """The machine in a text, or in JSON data, of any format; valid for any task or none.

        Raises:
            UsageError: It cannot be read; the message says why.
        """
        found: Machine = _functions().read_machine(source)
        return found

    @classmethod
    def from_file(cls, path: Path | str) -> Machine:
        """The machine in a file of any format (`.json`, `.bsg`), or the best one of a run.

        Raises:
            UsageError: It cannot be read; the message says why.
        """
        found: Machine = _functions().read_machine(Path(path))
        return found

    def edit(
        self, script: str, task: str | None = None, *, knobs: Mapping[str, object] | None = None
    ) -> Machine:
        """The machine after an edit script, which has one command per line; all or nothing.

        Args:
            script: Such as "Remove 4" or "Add 63 to 2 in x+"; ids are those of this machine.
            task: Level whose block list and limits hold; by default the core types and the standard
                building volume.
            knobs: Knobs of the level to change.

        Raises:
            UsageError: A command is refused; the message says which and why.
        """
        found: Machine = _functions().edit_machine(self, script, task, knobs)
        return found

    def check(self, task: str | None = None, **options: Any) -> Any:
        """The `Report` that `agentflow.check` gives of this machine; same arguments."""
        return _functions().check(self, task, **options)

    def simulate(self, task: str, **options: Any) -> Any:
        """The `Rollout` that `agentflow.simulate` gives of this machine; same arguments."""
        return _functions().simulate(self, task, **options)

    def verify(self, task: str, **options: Any) -> Any:
        """The `Verification` that `agentflow.verify` gives of this machine; same arguments."""
        return _functions().verify(self, task, **options)


def _functions() -> Any:
    """The functions for Python programs, as methods; machines know nothing of what they use."""
    return import_module("agentflow.api")


MachineJson = list[dict[str, int]] | dict[str, Any]
"""A list of blocks, or an object with `blocks`, `controls` and `controllers`."""


def with_controls(blocks: list[Any], machine: Machine) -> Any:
    """The JSON data of a machine whose blocks are written in some form."""
    if not machine.controlled:
        return blocks
    controls = [control.to_json() for control in machine.controls]
    return {
        "blocks": blocks,
        **({"controls": controls} if controls else {}),
        **({"controllers": machine.controllers.to_json()} if machine.controllers else {}),
    }


def lines_of(data: list[Any] | dict[str, Any]) -> str:
    """The JSON data of a machine as text, one block, control, sensor, law or output per line."""
    if isinstance(data, dict):
        parts = (
            f'"{key}": {lines_of(items) if key in _PARTS else json.dumps(items)}'
            for key, items in data.items()
        )
        return "{" + ",\n".join(parts) + "}"
    return "[\n" + ",\n".join("  " + json.dumps(item) for item in data) + "\n]"


_PARTS = frozenset({"blocks", "controls", "controllers", "sensors", "laws", "outputs"})
"""Keys of what is written on several lines."""


def renumber(
    steps: Iterable[Step], controls: Iterable[Control] = (), controllers: Controllers | None = None
) -> tuple[Machine, dict[int, int]]:
    """Close gaps in the ids of steps; return the machine and the map from old to new ids.

    Controls and controllers no longer name blocks that are not among the steps; what names no block
    is left out (see `Controllers.renamed`).
    """
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
    laws = controllers and controllers.renamed(ids)
    return Machine(tuple(new), tuple(rename_blocks(controls, ids)), laws), ids


def carried_by(steps: Iterable[Step], block: int, *, alone: bool = False) -> list[int]:
    """Ids of a block and of everything that is attached to it, in building order.

    Args:
        steps: Those of the machine; parents come first.
        block: Its id.
        alone: Leave out two-ended blocks that are attached to something else as well.
    """
    carried, attached = dict.fromkeys([block]), all if alone else any
    for step in steps:
        if step.parents and attached(parent in carried for parent in step.parents):
            carried[step.id] = None
    return list(carried)


def rename_blocks(controls: Iterable[Control], ids: Mapping[int, int]) -> Iterator[Control]:
    """Controls with the new ids of the blocks that they name; blocks without one are left out."""
    for control in controls:
        target = control.target
        if isinstance(target, tuple):
            target = tuple(ids[block] for block in target if block in ids)
        if target:
            yield replace(control, target=target)
