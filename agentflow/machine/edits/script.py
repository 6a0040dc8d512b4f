"""Edit scripts: apply a list of commands to a machine, all or nothing."""

import json
import re
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Literal

from agentflow.machine.blocks.library import library
from agentflow.machine.blocks.types import Group
from agentflow.machine.brief import Brief
from agentflow.machine.controls import GROUPS, NOT_SENSED
from agentflow.machine.edits.changes import add_images
from agentflow.machine.edits.commands import (
    CONTROL_GRAMMAR,
    CONTROLLER_GRAMMAR,
    GRAMMAR,
    NAMING,
    Add,
    AddControl,
    Command,
    ControlCommand,
    ControllerCommand,
    Face,
    Mirror,
    Move,
    Ref,
    Remove,
    RemoveControl,
    Replace,
    SetControl,
    SetNumber,
    WriteControllers,
    read_command,
    script_lines,
)
from agentflow.machine.edits.draft import NO_CONTROLS, Draft, End
from agentflow.machine.problems import Problem, RefusedEdit, comma_list
from agentflow.machine.tree import Machine, shorten

MAX_NAME = 32
_WORDS = frozenset({"add", "remove", "move", "to", "in", "as", "end", "replace", "with", "mirror"})
"""Words of the commands, which cannot be names."""
_EXAMPLE = "Add 63 to 3 in 0 as a"
MAX_COMMANDS = 500
"""Most commands of a script: enough to replace every block of a machine several times."""
MAX_WIDTH = 200
"""Most characters of a line that are shown with its verdict."""
NO_CHANGE = "the script has no commands, so the machine stays as it is"


class _Names:
    """Name -> id of the blocks that the script has named so far."""

    def __init__(self, commands: Sequence[Command | None]) -> None:
        """Take all commands of the script, to distinguish names of later lines from unknown
        ones."""
        self.given: dict[str, int] = {}
        self._all = {command.name for command in commands if isinstance(command, Add)} - {""}

    def give(self, name: str, block_id: int) -> None:
        """Name a block; raise `RefusedEdit` if the name is not allowed or taken."""
        if re.fullmatch(r"[+-]?[\d.]+", name):
            better = "b" + re.sub(r"\D", "", name)
            reason = f"the name {name} looks like an id; give it a letter, as in 'as {better}'"
            raise RefusedEdit("bad_name", reason)
        if name in _WORDS:
            raise RefusedEdit("bad_name", f"{name} is a word of the commands; choose another name")
        if not re.fullmatch(r"[a-z0-9_]+", name) or len(name) > MAX_NAME:
            rule = f"at most {MAX_NAME} letters, digits and underscores"
            raise RefusedEdit("bad_name", f"the name {name} is not allowed; use {rule}")
        if name in self.given:
            taken = f"the name {name} is already taken by new block {self.given[name]}"
            raise RefusedEdit("name_taken", f"{taken}; choose another name")
        self.given[name] = block_id

    def find(self, name: str) -> int:
        """The id of the block with a name; raise `RefusedEdit` if there is none."""
        if name in self.given:
            return self.given[name]
        if name in self._all:
            reason = f"the name {name} is given only in a later line; move that line up"
            raise RefusedEdit("name_not_yet_given", reason)
        if not self._all:
            reason = f"no block has the name {name}; use an id, or give the name: '{_EXAMPLE}'"
            raise RefusedEdit("unknown_name", reason)
        known = comma_list(sorted(self._all))
        raise RefusedEdit("unknown_name", f"no block has the name {name}; the names are: {known}")

    def name_of(self, block_id: int) -> str:
        """The name of a block; "" if it has none."""
        return next((name for name, id_ in self.given.items() if id_ == block_id), "")


@dataclass(frozen=True)
class StepVerdict:
    """The outcome of one line of a script."""

    text: str
    verdict: Literal["Success", "Error", "Unverified"]
    code: str = ""
    """Kind of error, or `no_change` for an empty script; "" if there is nothing to say."""
    reason: str = ""
    """Of an error, one sentence that a model can act on; of a success, what it has changed besides
    what the line says; "" if there is nothing to say."""

    def __str__(self) -> str:
        """Such as `Remove 7: Error (code: reason)`."""
        reason = f" ({self.code}: {self.reason})" if self.code else ""
        return f"{self.text[:MAX_WIDTH] or '(no command)'}: {self.verdict}{reason}"

    def to_json(self) -> dict[str, str]:
        """The verdict as JSON data."""
        return asdict(self)


@dataclass(frozen=True)
class EditOutcome:
    """The outcome of a script."""

    success: bool
    steps: tuple[StepVerdict, ...]
    machine: Machine
    """The edited machine; the given one if the script failed."""
    id_map: dict[int, int | None]
    """Id in the given machine -> id in `machine`; None for removed blocks."""
    names: dict[str, int | None] = field(default_factory=dict)
    """Name given by the script -> id in `machine`; None for blocks that it removed again."""

    @property
    def annotated(self) -> str:
        """The lines of the script, each with what it has changed besides what it says."""
        return "\n".join(
            f"{step.text.partition('//')[0].rstrip()}  // {step.reason}"
            if step.reason and not step.code
            else step.text
            for step in self.steps
        )

    @property
    def changes(self) -> list[str]:
        """What the lines have changed besides what they say themselves."""
        return [step.reason for step in self.steps if step.reason and step.verdict == "Success"]

    def to_json(self) -> dict[str, object]:
        """The outcome as JSON data; `names` only if the script gives any."""
        return {
            "outcome": "success" if self.success else "failure",
            "steps": [step.to_json() for step in self.steps],
            "machine": self.machine.to_json(),
            "id_map": {str(old): new for old, new in self.id_map.items()},
            **({"names": self.names} if self.names else {}),
        }


def apply_script(machine: Machine, script: str, brief: Brief | None = None) -> EditOutcome:
    """Apply an edit script to a file-valid machine. Never raises.

    The first command that fails stops the script and leaves the machine unchanged. The whole
    machine is checked after every command. On success, blocks keep their order, additions come
    last, followed by what was moved onto them, and ids are renumbered 0, 1, 2, ... Controls follow
    their blocks; those that drive no other block go with them. A script without commands succeeds
    and changes nothing.

    Args:
        machine: machine to edit.
        script: one command per line; ids are those of `machine` throughout.
        brief: the task, for its block list and limits; the core types and the standard
            building volume if None.
    """
    same: dict[int, int | None] = {step.id: step.id for step in machine}
    lines = script_lines(script)
    if not lines:
        return EditOutcome(
            True, (StepVerdict("", "Success", "no_change", NO_CHANGE),), machine, same
        )
    if len(lines) > MAX_COMMANDS:
        count = f"the script has {len(lines)} commands; the maximum is {MAX_COMMANDS}"
        reason = f"{count}: send fewer, or a whole machine"
        long = StepVerdict("", "Error", "too_many_commands", reason)
        return EditOutcome(False, (long,), machine, same)
    commands = [read_command(line) for line in lines]
    work = _Application(Draft(machine, brief), commands)
    verdicts: list[StepVerdict] = []
    for line, command in zip(lines, commands, strict=True):
        try:
            changed = work.apply(command)
        except RefusedEdit as refused:
            verdicts.append(StepVerdict(line, "Error", refused.code, refused.reason))
            verdicts += [StepVerdict(rest, "Unverified") for rest in lines[len(verdicts) :]]
            return EditOutcome(False, tuple(verdicts), machine, same)
        verdicts.append(StepVerdict(line, "Success", reason=changed))
    return EditOutcome(True, tuple(verdicts), *work.finish())


class _Application:
    """Applies commands to a draft: finds the blocks that they name, and checks after each."""

    def __init__(self, draft: Draft, commands: Sequence[Command | None]) -> None:
        """Begin with a draft; `commands` are those of the whole script, for messages."""
        self._draft = draft
        self._names = _Names(commands)

    def apply(self, command: Command | None) -> str:
        """Apply one command; what it has changed, in words, if the command does not say so itself.

        Raises `RefusedEdit` if it cannot be applied.
        """
        if command is None:
            controls = CONTROL_GRAMMAR if self._draft.brief and self._controlled else ()
            senses = CONTROLLER_GRAMMAR if self._draft.limits.senses else ()
            known = f"the commands are: {'; '.join((*GRAMMAR, *controls, *senses))}; {NAMING}"
            raise RefusedEdit("bad_format", f"not a command; {known}")
        if isinstance(command, WriteControllers | SetNumber):
            if self._draft.brief and not self._draft.limits.senses:
                raise RefusedEdit("controllers_not_allowed", f"{NOT_SENSED}; remove the line")
            return self._sense(command)
        if isinstance(command, AddControl | SetControl | RemoveControl):
            if not self._controlled:
                raise RefusedEdit("controls_not_allowed", NO_CONTROLS)
            return self._control(command)
        if isinstance(command, Add):
            return self._add(command)
        changed = self._change(command)
        self._require_space("")
        return changed

    def _change(self, command: Remove | Move | Replace | Mirror) -> str:
        if isinstance(command, Move):
            return self._move(command)
        if isinstance(command, Mirror):
            return self._mirror(command)
        if isinstance(command, Replace):
            block = self._find(command.block, "block", "replaced")
            return self._draft.retype(block, command.type)
        block = self._find(command.block, "block", "removed")
        self._draft.detach(block)
        self._draft.program.require_groups(block, self._draft.steps.values())
        return ""

    def finish(self) -> tuple[Machine, dict[int, int | None], dict[str, int | None]]:
        """The renumbered machine, and the maps from original ids and from names to its ids."""
        edited, new_ids = self._draft.finish()
        id_map = {old: new_ids.get(old) for old in range(self._draft.original)}
        return edited, id_map, {name: new_ids.get(id_) for name, id_ in self._names.given.items()}

    def _add(self, command: Add) -> str:
        ends = [self._end(ref, face) for ref, face in command.ends]
        added = self._draft.attach(command.type, ends)
        for problem in self._draft.crowding:
            raise RefusedEdit(problem.code, f"with this block {problem.message} in an earlier line")
        if command.name:
            self._names.give(command.name, added.id)
        label = f"{added.id} ({command.name})" if command.name else added.id
        self._require_space(f"with {library()[command.type].name} as new block {label}: ")
        return ""

    def _mirror(self, command: Mirror) -> str:
        what = command.what
        if what not in ("x+", "x-"):
            what = self._find(what, "block", "mirrored")
        images = add_images(self._draft, what)
        for problem in self._draft.crowding:
            raise RefusedEdit(problem.code, f"with the mirror image {problem.message}")
        added = comma_list(f"block {block}" for block in images)
        return f"added the mirror image of {added}"

    def _move(self, command: Move) -> str:
        block = self._find(command.block, "block", "moved")
        if not command.end:
            self._draft.movable(block)
        to = self._end(command.parent, command.face)
        if block <= to[0] < self._draft.original:
            reason = f"new parent {to[0]} does not come before block {block}"
            rule = "a parent must have a smaller id or be added by this script"
            raise RefusedEdit("parent_not_earlier", f"{reason}; {rule}")
        if command.end:
            self._draft.reattach_end(block, command.end, to)
        else:
            self._draft.reattach(block, to)
        return ""

    def _end(self, ref: Ref, face: Face) -> End:
        parent = self._find(ref, "parent", "used as a parent")
        return parent, face if isinstance(face, int) else self._draft.face_towards(parent, face)

    @property
    def _controlled(self) -> bool:
        """Whether the machine may have controls: without a task it may."""
        return self._draft.brief is None or self._draft.limits.controls is not None

    def _control(self, command: ControlCommand) -> str:
        draft = self._draft
        if isinstance(command, RemoveControl):
            return draft.program.remove(command.number)
        steps, window = draft.steps.values(), draft.limits.controls
        if isinstance(command, SetControl):
            return draft.program.set(command.number, dict(command.values), steps, window)
        group = self._group_of(command.target)
        target = group or tuple(self._find(ref, "block", "controlled") for ref in command.target)
        draft.program.add(target, command, steps, window)
        return ""

    def _sense(self, command: ControllerCommand) -> str:
        from agentflow.machine.controllers.reading import read_controllers
        from agentflow.machine.numbers import numbers_of, with_number  # needs pydantic

        draft, problems = self._draft, list[Problem]()
        if isinstance(command, WriteControllers):
            written = command.text and read_controllers(self._identified(command.text), problems)
            for problem in problems:
                raise RefusedEdit(problem.code, problem.message)
            draft.set_controllers(written or None)
            return ""
        if draft.controllers is None:
            reason = "the machine has no controllers: write them with Controllers first"
            raise RefusedEdit("number_not_found", reason)
        before = draft.controllers
        draft.set_controllers(with_number(before, command.path, command.value))
        old = {path: value for path, value, *_ in numbers_of(before)}.get(command.path)
        was = "none" if old is None else shorten(old)
        return f"{command.path} {was} -> {shorten(command.value)}"

    def _identified(self, text: str) -> object:
        """The JSON data of controllers, with ids in place of the names that the script gives."""
        try:
            data = json.loads(text)
        except (ValueError, RecursionError):
            reason = "the controllers are no JSON: write one object on one line, or none"
            raise RefusedEdit("not_a_controller", reason) from None
        sensors, outputs = data.get("sensors"), data.get("outputs")
        found = [*sensors.values()] if isinstance(sensors, dict) else []
        for item in found + outputs if isinstance(outputs, list) else found:
            if isinstance(item, dict) and isinstance(name := item.get("block"), str):
                item["block"] = self._find(name, "block", "sensed")
            if isinstance(item, dict) and isinstance(names := item.get("blocks"), list):
                item["blocks"] = [
                    self._find(each, "block", "driven") if isinstance(each, str) else each
                    for each in names
                ]
        return data

    def _group_of(self, target: Sequence[Ref]) -> Group | None:
        """The group that words name; None if they name blocks."""
        words = "_".join(map(str, target))
        named = len(target) == 1 and target[0] in self._names.given
        return next((group for group in GROUPS if group == words and not named), None)

    def _find(self, ref: Ref, what: str, use: str) -> int:
        """The id of a block that is still there; `what` begins the codes of refusals."""
        block_id = self._names.find(ref) if isinstance(ref, str) else ref
        if isinstance(ref, int) and not 0 <= ref < self._draft.original:
            raise RefusedEdit(f"{what}_not_found", self._absent(ref, use))
        if block_id not in self._draft.steps:
            label = ref if isinstance(ref, str) else f"block {ref}"
            raise RefusedEdit(f"{what}_removed", f"{label} was removed earlier in this script")
        return block_id

    def _absent(self, block_id: int, use: str) -> str:
        original = self._draft.original
        if original <= block_id < self._draft.next_id:
            name = self._names.name_of(block_id)
            how = f"use its name, {name}" if name else "name it, as in 'Add 15 to 0 in 4 as a'"
            return f"block {block_id} is added by this script; it can be {use} by name only: {how}"
        return f"block {block_id} does not exist; the blocks are 0 to {original - 1}"

    def _require_space(self, prefix: str) -> None:
        """Refuse if the current machine is spatially invalid."""
        for problem in self._draft.problems[:1]:
            raise RefusedEdit(problem.code, prefix + problem.message)
