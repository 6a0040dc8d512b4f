"""Folders that a command fills and can continue: the plan in `plan.json`, then growing files.

A killed command loses at most the line that it was writing; the same command again continues it.
"""

from __future__ import annotations

import asyncio
import json
from collections import deque
from collections.abc import AsyncIterator, Awaitable, Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, ValidationError

from agentflow.app.sweeps.folder import first_difference
from agentflow.errors import InterruptedRunError, RunError
from agentflow.files import (
    LineFile,
    cannot_write,
    hold_folder,
    parse_object,
    remove_partial_files,
    whole_lines,
    write_atomically,
)

PLAN = "plan.json"
"""What a folder holds, and everything that decides its content; written first."""
AGAIN = "repeat the command to continue"

_T = TypeVar("_T")
_U = TypeVar("_U")
_Model = TypeVar("_Model", bound=BaseModel)


@contextmanager
def work_in(folder: Path, plan: BaseModel, log: str) -> Iterator[None]:
    """Begin the work of a plan in a folder, or continue it; the folder is locked meanwhile.

    Args:
        folder: Created if missing.
        plan: What to do. A folder with another plan is refused unless its log is still empty.
        log: Name of the file that holds the work done so far.

    Raises:
        RunError: The folder holds something else, is in use, or cannot be written.
        InterruptedRunError: Ctrl-C; the same command continues.
    """
    with hold_folder(folder):
        try:
            remove_partial_files(folder)
            _require_plan(folder, plan, log)
            yield
        except OSError as error:
            raise cannot_write(folder, error) from None
        except KeyboardInterrupt:
            raise InterruptedRunError(f"interrupted; {AGAIN}") from None


def _require_plan(folder: Path, plan: BaseModel, log: str) -> None:
    file, wanted = folder / PLAN, plan.model_dump(mode="json")
    begun = parse_object(file.read_bytes()) if file.is_file() else None
    if begun is None and _holds_files(folder):
        raise RunError(
            f"{folder} holds files, but no {PLAN} of this command; choose an empty folder with "
            "--out"
        )
    if begun == wanted:
        return
    if begun is not None and (folder / log).exists() and (folder / log).stat().st_size:
        key = first_difference(begun, wanted)
        raise RunError(
            f"{folder} was started with a different value of {key}: repeat "
            "the command that started it, or choose another folder with --out"
        )
    with write_atomically(file) as part:
        part.write_text(json.dumps(wanted, indent=1) + "\n", encoding="utf-8")


def _holds_files(folder: Path) -> bool:
    return any(item.name != ".lock" for item in folder.iterdir())


def read_plan(folder: Path, kind: type[_Model], command: str) -> _Model:
    """The plan of a folder that `command` has made.

    Raises:
        RunError: It is not such a folder.
    """
    try:
        return kind.model_validate_json((folder / PLAN).read_bytes())
    except (OSError, ValidationError):
        raise RunError(
            f"{folder} is not a folder made by {command}: it has no readable {PLAN} of that kind"
        ) from None


def read_lines(file: Path, kind: type[_Model]) -> Iterator[_Model]:
    """The complete lines of a growing file, one at a time; none if there is no file.

    Raises:
        RunError: A line is damaged.
    """
    for number, line in whole_lines(file) if file.exists() else ():
        try:
            yield kind.model_validate_json(line)
        except ValidationError:
            raise RunError(f"{file} is damaged in line {number}") from None


@contextmanager
def open_log(file: Path, kind: type[_Model]) -> Iterator[tuple[LineFile, list[_Model]]]:
    """A growing file, open for further lines, and its complete lines; a half one is removed.

    Raises:
        RunError: A line is damaged.
    """
    lines = LineFile(file)
    try:
        yield lines, list(read_lines(file, kind))
    finally:
        lines.close()


def require_same(file: Path, found: Iterable[object], expected: Iterable[object]) -> None:
    """Refuse a growing file whose lines are not the first ones of the plan.

    Raises:
        RunError: They are not; the message names the first such line.
    """
    wanted = iter(expected)
    for number, item in enumerate(found, start=1):
        if item != next(wanted, None):
            raise RunError(f"{file} is damaged in line {number}: the plan has another one there")


async def map_in_order(
    items: Iterable[_T], work: Callable[[_T], Awaitable[_U]], most: int
) -> AsyncIterator[_U]:
    """Results in the order of the items, of which at most `most` are worked on at a time."""
    waiting: deque[asyncio.Future[_U]] = deque()
    try:
        for item in items:
            waiting.append(asyncio.ensure_future(work(item)))
            if len(waiting) == most:
                yield await waiting.popleft()
        while waiting:
            yield await waiting.popleft()
    finally:
        for future in waiting:
            future.cancel()
        await asyncio.gather(*waiting, return_exceptions=True)


@contextmanager
def hold_new(folder: Path) -> Iterator[None]:
    """Lock a new or empty folder for work that is done at once.

    Raises:
        RunError: It is not empty, is in use, or cannot be written.
    """
    with hold_folder(folder):
        if _holds_files(folder):
            raise RunError(f"{folder} is not empty; choose another folder with --out")
        yield
