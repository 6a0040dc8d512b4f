"""The folder that a program works in: what it finds there, and the machines that it leaves."""

import json
import os
import stat
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from heapq import nsmallest
from pathlib import Path

from agentflow.files.templates import fill
from agentflow.machine.tree import Machine
from agentflow.runs.locations import StageName
from agentflow.tools import ToolSpec

TASK, MCP, MACHINES, BEFORE = "TASK.md", ".mcp.json", "machines", "before"
URL, TOKEN = "AGENTFLOW_BENCH", "AGENTFLOW_BENCH_TOKEN"
"""Environment variables: where the tools are, and the bearer token that they ask for."""
MOST_FILES = 100
"""Most machine files that are read."""
LARGEST = 1 << 20
"""Most bytes of a machine file; a machine of 800 blocks has about 60,000."""


@dataclass(frozen=True)
class Assignment:
    """What a program is to do in a stage."""

    stage: StageName
    task: str
    """The task, the blocks, the rules and the budget, as the tool `brief` returns them."""
    tools: Sequence[ToolSpec]
    limit: float
    """Seconds until the program is stopped."""
    before: Mapping[str, Machine]
    """Name -> machine submitted in an earlier stage, or given to start with."""


def write_folder(folder: Path, assignment: Assignment, url: str, token: str) -> None:
    """Write everything that a program finds in its empty folder."""
    (folder / TASK).write_text(task_text(assignment), encoding="utf-8")
    server = {"type": "http", "url": url, "headers": {"Authorization": f"Bearer {token}"}}
    config = json.dumps({"mcpServers": {"agentflow": server}}, indent=1)
    (folder / MCP).write_text(f"{config}\n", encoding="utf-8")
    before = folder / MACHINES / BEFORE
    before.mkdir(parents=True)
    for name, machine in assignment.before.items():
        (before / f"{name}.json").write_text(machine.to_text() + "\n", encoding="utf-8")


def task_text(assignment: Assignment) -> str:
    """The text of TASK.md."""
    limit = assignment.limit
    return fill(
        "agentflow.integrations",
        TASK,
        stage=assignment.stage,
        time=f"{limit:.3g} seconds" if limit < 120 else f"{limit / 60:.3g} minutes",
        machines=MACHINES,
        before=f"{MACHINES}/{BEFORE}" if assignment.before else "",
        mcp=MCP,
        url=URL,
        token=TOKEN,
        tools=assignment.tools,
        task=assignment.task.strip(),
    )


@dataclass(frozen=True)
class MachineFile:
    """A file that should hold a machine."""

    name: str
    """Its name in the folder, fit to be written anywhere."""
    text: str | None = None
    """What it holds; None if it must not or cannot be read."""
    problem: str = ""
    """Why not, and what to write instead."""


@dataclass(frozen=True)
class MachineFiles:
    """The machine files of a folder, in the order of their names."""

    read: tuple[MachineFile, ...] = ()
    more: int = 0
    """Number of files beyond the `MOST_FILES` that are read."""
    problem: str = ""
    """Why the folder itself must not or cannot be read."""


def read_machine_files(folder: Path) -> MachineFiles:
    """The files `*.json` directly in a folder; none if it is not there or is a link.

    No file is opened that is not a plain file of its own: links, pipes, devices and folders are
    refused. Nothing may write to the folder any more.
    """
    try:
        if not stat.S_ISDIR(folder.lstat().st_mode):
            return MachineFiles(problem="it is not a folder; leave it as it is")
        count = sum(1 for _ in _names(folder))
        names = nsmallest(MOST_FILES, _names(folder))
    except OSError as error:
        return MachineFiles(problem=f"it cannot be read: {error.strerror}")
    return MachineFiles(tuple(_read(folder / name) for name in names), count - len(names))


def _names(folder: Path) -> Iterator[str]:
    with os.scandir(folder) as entries:
        for entry in entries:
            if entry.name.endswith(".json") and not entry.name.startswith("."):
                yield entry.name


def _read(path: Path) -> MachineFile:
    name = _printable(path.name)
    try:
        content, problem = _content(path)
    except OSError as error:
        content, problem = b"", f"it cannot be read: {error.strerror}"
    if problem:
        return MachineFile(name, None, problem)
    try:
        return MachineFile(name, content.decode("utf-8"))
    except UnicodeDecodeError as error:
        why = f"byte {error.start + 1} is not UTF-8; write the machine as UTF-8 text"
        return MachineFile(name, None, why)


def _content(path: Path) -> tuple[bytes, str]:
    """The bytes of a file, or a problem."""
    if problem := _kind_problem(path.lstat()):
        return b"", problem
    flags = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
    with open(os.open(path, flags | getattr(os, "O_BINARY", 0)), "rb") as file:
        if problem := _kind_problem(os.fstat(file.fileno())):
            return b"", problem
        content = file.read(LARGEST + 1)
    if len(content) > LARGEST:
        return b"", f"it has more than {LARGEST:,} bytes; write one machine and nothing else"
    return content, ""


def _kind_problem(status: os.stat_result) -> str:
    """What is wrong with a file that is not a plain file with a single name; "" if it is one."""
    if stat.S_ISLNK(status.st_mode) or (stat.S_ISREG(status.st_mode) and status.st_nlink > 1):
        return "it is a link; write the machine itself"
    if stat.S_ISDIR(status.st_mode):
        return "it is a folder; write a file"
    if not stat.S_ISREG(status.st_mode):
        return "it is a pipe, a socket or a device; write a file"
    return ""


def _printable(name: str) -> str:
    """A file name, which may hold any bytes, as text without control characters."""
    text = os.fsencode(name).decode("utf-8", "backslashreplace")
    return "".join(char if char.isprintable() else ascii(char)[1:-1] for char in text)


def remove_folder(folder: Path) -> None:
    """Remove a folder that nobody writes to any more, however deep it is.

    Every folder in it moves to the top before it is emptied, so that no path is long and nothing
    calls itself.

    Raises:
        OSError: Something in it cannot be removed.
    """
    top = folder.with_name(f"{folder.name}-removed")
    top.mkdir()
    found, emptied = 1, 0
    folder.rename(top / "0")
    while emptied < found:
        inner = top / str(emptied)
        inner.chmod(stat.S_IRWXU)
        with os.scandir(inner) as entries:
            for entry in entries:
                if entry.is_dir(follow_symlinks=False):
                    os.chmod(entry.path, stat.S_IRWXU)
                    os.rename(entry.path, top / str(found))
                    found += 1
                else:
                    os.unlink(entry.path)
        inner.rmdir()
        emptied += 1
    top.rmdir()
