"""Folders that a command fills and can continue: the plan in `plan.json`, then growing files.

A killed command loses at most the line that it was writing; the same command again continues it.
"""

from collections.abc import Collection, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel

from agentflow.errors import RunError
from agentflow.files.documents import Difference, Document
from agentflow.files.folders import hold_folder, out_errors, visible_names
from agentflow.files.lines import LineFile, open_lines, read_lines
from agentflow.models.choices import continuable

PLAN = "plan.json"
"""What a folder holds, and everything that decides its content; written first."""
AGAIN = "repeat the command to continue"

_Model = TypeVar("_Model", bound=BaseModel)


class _Plan(Document[_Model]):
    """What a command was asked to do in a folder; that of another command counts as none."""

    def find(self, folder: Path, leftovers: Collection[str] = ()) -> _Model | None:
        try:
            return self.read(folder)
        except RunError:
            if visible_names(folder).difference(leftovers):
                raise RunError(
                    f"{folder} holds files, but no {PLAN} of this command; choose an empty folder "
                    "with --out"
                ) from None
        return None

    def differs(self, folder: Path, different: Difference) -> RunError:
        return RunError(
            f"{folder} was started with a different value of {different.key}: repeat the command "
            "that started it, or choose another folder with --out"
        )


@contextmanager
def work_in(folder: Path, plan: BaseModel, log: str) -> Iterator[None]:
    """Begin the work of a plan in a folder, or continue it; the folder is locked meanwhile.

    Args:
        folder: Created if missing.
        plan: What to do. A folder with another plan is refused unless its log is still empty.
        log: Name of the file that holds the work done so far.

    Raises:
        RunError: The folder holds something else, is in use, or cannot be written.
        EndpointError, ConfigError, InterruptedRunError: See `continuable`.
    """
    with hold_folder(folder), continuable(AGAIN), out_errors(folder):
        _Plan(PLAN, type(plan), "a folder of this command").begin(folder, plan, (log,))
        yield


def read_plan(folder: Path, kind: type[_Model], command: str) -> _Model:
    """The plan of a folder that `command` has made.

    Raises:
        RunError: It is not such a folder.
    """
    try:
        return _Plan(PLAN, kind, "a folder of this command").read(folder)
    except RunError:
        raise RunError(
            f"{folder} is not a folder made by {command}: it has no readable {PLAN} of that kind"
        ) from None


def read_log(file: Path, kind: type[_Model]) -> Iterator[_Model]:
    """The complete lines of a growing file, one at a time; none if there is no file.

    Raises:
        RunError: A line is damaged.
    """
    return read_lines(file, kind.model_validate_json, _damaged)


def _damaged(file: Path, number: int, _why: ValueError) -> RunError:
    return RunError(f"{file} is damaged in line {number}")


def open_log(
    file: Path, kind: type[_Model]
) -> AbstractContextManager[tuple[LineFile, list[_Model]]]:
    """A growing file, open for further lines, and its complete lines; a half one is removed.

    Raises:
        RunError: A line is damaged.
    """
    return open_lines(file, kind.model_validate_json, _damaged)
