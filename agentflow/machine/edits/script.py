"""Edit scripts: apply a list of commands to a machine, all or nothing."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Literal

from agentflow.machine.brief import Brief
from agentflow.machine.edits.commands import read_command, script_lines
from agentflow.machine.edits.draft import Draft
from agentflow.machine.edits.names import Refused
from agentflow.machine.tree import Machine

MAX_COMMANDS = 500
"""Most commands of a script: enough to replace every block of a machine several times."""
NO_CHANGE = "the script has no commands, so the machine stays as it is"


@dataclass(frozen=True)
class StepVerdict:
    """The outcome of one line of a script."""

    text: str
    """The line as written."""
    verdict: Literal["Success", "Error", "Unverified"]
    code: str = ""
    """Kind of error, or `no_change` for an empty script; "" if there is nothing to say."""
    reason: str = ""
    """One sentence that a model can act on; "" if there is nothing to say."""

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
        return EditOutcome(False, (_too_long(len(lines)),), machine, same)
    commands = [read_command(line) for line in lines]
    draft = Draft(machine, brief, commands)
    verdicts: list[StepVerdict] = []
    for line, command in zip(lines, commands, strict=True):
        try:
            draft.apply(command)
        except Refused as refused:
            verdicts.append(StepVerdict(line, "Error", refused.code, refused.reason))
            verdicts += [StepVerdict(rest, "Unverified") for rest in lines[len(verdicts) :]]
            return EditOutcome(False, tuple(verdicts), machine, same)
        verdicts.append(StepVerdict(line, "Success"))
    return EditOutcome(True, tuple(verdicts), *draft.finish())


def _too_long(count: int) -> StepVerdict:
    reason = (
        f"the script has {count} commands; the most is {MAX_COMMANDS}: send fewer, or a whole "
        "machine"
    )
    return StepVerdict("", "Error", "too_many_commands", reason)
