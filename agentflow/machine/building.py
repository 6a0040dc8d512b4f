"""Building a machine in Python, block by block, by names of types and of faces."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType, TracebackType

from agentflow.errors import UnknownNameError
from agentflow.machine.blocks.library import library
from agentflow.machine.blocks.types import Group
from agentflow.machine.brief import LONE_ROOT, Brief
from agentflow.machine.controls import GROUPS
from agentflow.machine.edits.commands import AddControl
from agentflow.machine.edits.draft import NO_CONTROLS, Draft, End
from agentflow.machine.problems import RefusedEdit
from agentflow.machine.tree import Machine
from agentflow.machine.validity import problems_of

WORDS: Mapping[str, str] = MappingProxyType(
    {"up": "y+", "down": "y-", "right": "x+", "left": "x-", "front": "z+", "back": "z-"}
)
"""Word for a direction of the machine frame -> its axis."""


@dataclass(frozen=True)
class BuiltBlock:
    """A block of a machine that is being built."""

    id: int
    """Its id in the machine."""
    type: int
    """Its type id."""
    _draft: Draft = field(repr=False, compare=False)

    def face(self, face: int | str) -> End:
        """One of its faces, as (block id, face id), for `MachineBuilder.join`.

        Args:
            face: Its number, or where it looks in the machine frame: `up`, `down`, `left`, `right`,
                `front`, `back`, or an axis such as `x+`. Where several faces look there, a second
                axis says where it lies: of those of `x+z-`, the one furthest to z-.

        Raises:
            RefusedEdit: There is no such face, or several.
            UnknownNameError: The word names no direction.
        """
        if isinstance(face, int):
            return self.id, face
        word = face.strip().lower()
        axes = WORDS.get(word, word)
        if not re.fullmatch(r"([xyz][+-]){1,3}", axes):
            raise UnknownNameError("direction", face, [*WORDS, *WORDS.values()])
        return self.id, self._draft.face_towards(self.id, axes)


class MachineBuilder:
    """A machine that is being built; every step is checked when it is made.

    In a `with` block, the end checks that the machine is complete: it raises UsageError with the
    first problem, such as a required block that is missing.
    """

    def __init__(self, brief: Brief | None = None) -> None:
        """Begin with the given blocks of a task, or with a lone root.

        Args:
            brief: The task, for its block list and limits; the core types and the standard building
                volume if None.
        """
        self._brief = brief
        self._draft = Draft(brief.given if brief else LONE_ROOT, brief)

    @property
    def root(self) -> BuiltBlock:
        """The first block."""
        return self[0]

    def __getitem__(self, block: int) -> BuiltBlock:
        """A block by its id; IndexError if there is none."""
        if block not in self._draft.steps:
            raise IndexError(f"no block {block}; the blocks are 0 to {len(self._draft.steps) - 1}")
        return BuiltBlock(block, self._draft.steps[block].type, self._draft)

    def __len__(self) -> int:
        return len(self._draft.steps)

    def __enter__(self) -> MachineBuilder:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, _: BaseException | None, __: TracebackType | None
    ) -> None:
        problems = problems_of(self.machine, self._brief) if self._brief and kind is None else ()
        if problems:
            raise RefusedEdit(problems[0].code, problems[0].message)

    @property
    def machine(self) -> Machine:
        """The machine as it is now; it does not change when the builder goes on."""
        return self._draft.finish()[0]

    def add(self, block: str | int, to: BuiltBlock, face: int | str) -> BuiltBlock:
        """Attach a block to a face of another.

        Args:
            block: Name or number of its type, such as "Log" or 63.
            to: The block that carries it.
            face: The face of that block; see `BuiltBlock.face`.

        Raises:
            RefusedEdit: The type is not allowed, the face does not exist or is taken, the machine
                would overlap or be too large, or `to` is a block of another builder.
            UnknownNameError: There is no such type.
        """
        if to._draft is not self._draft:
            what = f"block {to.id} is of another machine: name a block of this one"
            raise RefusedEdit("unknown_name", what)
        return self._attach(block, [to.face(face)])

    def join(self, block: str | int, first: End, second: End) -> BuiltBlock:
        """Put a two-ended block (brace, spring, winch) between two faces.

        Args:
            block: Name or number of its type, such as "Brace".
            first: Where it begins, such as `beam.face(3)`.
            second: Where it ends.

        Raises:
            RefusedEdit: As for `add`.
            UnknownNameError: There is no such type.
        """
        return self._attach(block, [first, second])

    def control(
        self, target: Group | Sequence[BuiltBlock], *, at: float, lasts: float, level: float
    ) -> None:
        """Drive blocks by the machine's own control program, in place of the task's schedule.

        Args:
            target: The blocks, or a group such as "motors".
            at: When it begins, in seconds since t = 0.
            lasts: For how long it holds, s.
            level: Share of the full speed, thrust or pull, from -1 (backwards) to 1.

        Raises:
            RefusedEdit: The task allows no controls, or the entry is wrong.
        """
        window = self._draft.limits.controls
        if self._brief is not None and window is None:
            raise RefusedEdit("controls_not_allowed", NO_CONTROLS)
        if isinstance(target, str) and target not in GROUPS:
            raise UnknownNameError("group of blocks", target, GROUPS)
        blocks = target if isinstance(target, str) else tuple(block.id for block in target)
        entry = AddControl((), at, lasts, level)
        self._draft.program.add(blocks, entry, self._draft.steps.values(), window)

    def _attach(self, block: str | int, ends: Sequence[End]) -> BuiltBlock:
        kind, draft = library().find(block), self._draft
        added = draft.attach(kind.type, ends)
        if problems := [*draft.crowding, *draft.problems]:
            del draft.steps[added.id]
            draft.next_id -= 1
            what = f"with {kind.name} as block {added.id}: {problems[0].message}"
            raise RefusedEdit(problems[0].code, what)
        return self[added.id]
