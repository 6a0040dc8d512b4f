"""What the page sends about a machine that is being built."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from agentflow.app.tasks import find_task
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.registry import task_names
from agentflow.errors import UnknownNameError, UsageError
from agentflow.machine import Machine, check
from agentflow.machine.formats.detect import read_for
from agentflow.studio.answers import Arguments
from agentflow.studio.building.rules import Rules
from agentflow.studio.folder import LONGEST
from agentflow.study.session import Written


class OnTask(Arguments):
    """A task by name."""

    task: str = Field(max_length=80)

    @property
    def level(self) -> Task:
        """The task.

        Raises:
            UnknownNameError: It is not a known level.
        """
        if self.task not in task_names():
            raise UnknownNameError("task", self.task, task_names())
        return find_task(self.task)


class Built(OnTask):
    """A machine for a task."""

    machine: Written

    def read(self) -> tuple[Machine, Rules]:
        """The machine and its rules.

        Raises:
            UsageError: It is not file-valid.
        """
        machine = read_for_task(self.level, self.machine)
        return machine, Rules(machine, self.level.brief)


class Asked(Built):
    """What to find faces for: a new block, or one to move or copy."""

    add: int | None = None
    first: list[int] | None = Field(None, min_length=2, max_length=2)
    """The first end of a two-ended block."""
    move: int | None = None
    copy_of: int | None = None


class Edited(Built):
    """A change."""

    do: Literal["add", "remove", "move", "turn", "copy", "mirror"]
    block: int = Field(0, ge=0)
    type: int = 0
    ends: list[list[int]] = Field([], max_length=2)


class Opened(OnTask):
    """The text of a machine file."""

    text: str = Field(max_length=4_000_000)
    name: str = Field("", max_length=LONGEST)


class Recorded(Arguments):
    """A machine of a run; without a hash, its best one."""

    run: str = Field(max_length=LONGEST)
    machine: str | None = Field(None, pattern="^[0-9a-f]{16}$")


def read_for_task(task: Task, source: object, *, is_bsg: bool = False) -> Machine:
    """The machine in what the page sent; UsageError if it is not file-valid."""
    report = check(read_for(task.brief, source, "bsg" if is_bsg else "auto"), task.brief)
    if report.machine is None:
        raise UsageError(report.problems[0].message)
    return report.machine
