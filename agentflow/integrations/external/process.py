"""Runs a program for a limited time, keeps its output, and kills it with all its children."""

from __future__ import annotations

import asyncio
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from agentflow.errors import AgentflowError

GRACE = 5.0
"""Seconds to end by itself: enough to write a file, short enough to wait for."""
REST = 1.0
"""Seconds to wait for the rest of an output once everything known has been killed."""
KILL_ROUNDS = 20
"""Most attempts to kill everything: a child may start another one between two looks."""
HEAD = 1 << 20
"""Bytes kept of the beginning of an output."""
TAIL = 1 << 16
"""Bytes kept of its end."""


@dataclass(frozen=True)
class ProgramCommand:
    """What to run, for how long, and with which environment."""

    words: Sequence[str]
    environment: Mapping[str, str]
    """All variables that the program gets."""
    mark: str
    """Name of one of them, whose value no other program has: it marks all its children."""
    limit: float
    """Seconds after which it is stopped."""
    grace: float = GRACE
    """Seconds that it gets to end by itself once it has been asked to."""


@dataclass(frozen=True)
class Ending:
    """How a program ended."""

    status: int
    """Exit status; the negative number of the signal that killed it."""
    timed_out: bool
    """Whether it was stopped at its limit."""


async def run_program(
    command: ProgramCommand, folder: Path, given: Path, write: Callable[[bytes], None]
) -> Ending:
    """Run a program in a folder until it ends or its limit is reached, then kill what is left.

    Args:
        command: What to run.
        folder: Its working directory.
        given: A file that it gets as its standard input.
        write: Receives its standard output and standard error, as `BoundedOutput` bounds them.

    Raises:
        OSError: It cannot be started.
        AgentflowError: `write` raised it.
    """
    output = BoundedOutput(write)
    mark = f"{command.mark}={command.environment[command.mark]}"
    with _requests_to_end() as requests, given.open("rb") as opened:
        transport, program = await asyncio.get_running_loop().subprocess_exec(
            lambda: _Program(output),
            *command.words,
            cwd=folder,
            env=dict(command.environment),
            stdin=opened,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        requests.cancel_from_now_on()
        try:
            timed_out = not await _is_done(program.exited, command.limit)
        finally:
            try:
                await _stop(transport.get_pid(), mark, program.exited, command.grace)
                await _is_done(program.closed, REST)  # a child that escaped may keep the pipe open
            finally:
                transport.close()
                output.close()
    program.exited.result()
    status = transport.get_returncode()
    assert status is not None
    return Ending(status, timed_out)


class _Requests:
    """Counts requests to end this process. From some moment on, each cancels the current task."""

    def __init__(self) -> None:
        self.count = 0
        self._cancel: Callable[[], object] | None = None

    def cancel_from_now_on(self) -> None:
        """Cancel the current task for each further request, and for those that have come."""
        loop, task = asyncio.get_running_loop(), asyncio.current_task()
        assert task is not None
        self._cancel = partial(loop.call_soon_threadsafe, task.cancel)
        if self.count:
            self._cancel()

    def __call__(self, *_: object) -> None:
        self.count += 1
        if self._cancel is not None:
            self._cancel()


@contextmanager
def _requests_to_end() -> Iterator[_Requests]:
    """Requests to end this process, which then interrupt it as Ctrl-C does, but not before the
    program has been killed: by default, the process would end at once and leave it running.

    The first asks the program to end, the second kills it at once.

    Raises:
        KeyboardInterrupt: At the end, if there were any.
    """
    numbers = [signal.SIGTERM, *([signal.SIGHUP] if sys.platform != "win32" else [])]
    here = threading.current_thread() is threading.main_thread()
    ours = [item for item in numbers if here and signal.getsignal(item) is signal.SIG_DFL]
    requests = _Requests()
    for item in ours:
        signal.signal(item, requests)
    try:
        yield requests
    finally:
        for item in ours:
            signal.signal(item, signal.SIG_DFL)
        if requests.count:
            raise KeyboardInterrupt


class _Program(asyncio.SubprocessProtocol):
    """A running program, whose output goes to `output`."""

    def __init__(self, output: BoundedOutput) -> None:
        loop = asyncio.get_running_loop()
        self._output = output
        self.exited: asyncio.Future[None] = loop.create_future()
        """Done once the program has ended, whether or not its children have."""
        self.closed: asyncio.Future[None] = loop.create_future()
        """Done once nobody can write to its output any more."""

    def pipe_data_received(self, fd: int, data: bytes) -> None:  # noqa: ARG002
        try:
            self._output.add(data)
        except AgentflowError as error:
            if not self.exited.done():
                self.exited.set_exception(error)

    def pipe_connection_lost(self, fd: int, exc: Exception | None) -> None:  # noqa: ARG002
        if not self.closed.done():
            self.closed.set_result(None)

    def process_exited(self) -> None:
        if not self.exited.done():
            self.exited.set_result(None)


async def _is_done(future: asyncio.Future[None], seconds: float) -> bool:
    """Whether something happens within some seconds; waits for it without consuming it."""
    await asyncio.wait([future], timeout=seconds)
    return future.done()


async def _stop(leader: int, mark: str, exited: asyncio.Future[None], grace: float) -> None:
    """Ask a program and its children to end, and kill those that do not, or at once if cancelled.

    Its children are its session and, on Linux, all processes that carry its mark: those that
    have left the session keep their environment.
    """
    clock = asyncio.get_running_loop().time
    deadline = clock() + grace
    try:
        _signal_all(leader, mark, signal.SIGTERM)
        while clock() < deadline and not (exited.done() and not any(_marked(mark))):
            await asyncio.sleep(0.05)
    finally:
        for _ in range(KILL_ROUNDS):
            _signal_all(leader, mark, KILL)
            if not any(_marked(mark)):
                break
    await _is_done(exited, grace)


if sys.platform == "win32":
    KILL = signal.SIGTERM

    def _signal_all(leader: int, mark: str, number: int) -> None:  # noqa: ARG001
        """Kill a process tree: Windows has no signals that ask a program to end."""
        subprocess.run(
            ["taskkill", "/T", "/F", "/PID", str(leader)], capture_output=True, check=False
        )

else:
    KILL = signal.SIGKILL

    def _signal_all(leader: int, mark: str, number: int) -> None:
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(leader, number)
        for pid in _marked(mark):
            with suppress(ProcessLookupError, PermissionError):
                if os.getpgid(pid) != leader:  # one that ends may not survive a second signal
                    os.kill(pid, number)


def _marked(mark: str) -> Iterator[int]:
    """The processes whose environment holds `NAME=value`; none on systems without /proc."""
    sought = b"\0" + os.fsencode(mark) + b"\0"
    for folder in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):  # another user's, or it has ended
            if sought in b"\0" + (folder / "environ").read_bytes():
                yield int(folder.name)


class BoundedOutput:
    """Writes the beginning of an output as it comes, and the end of a long one when it closes."""

    def __init__(self, write: Callable[[bytes], None]) -> None:
        self._write = write
        self._room = HEAD
        self._tail = b""
        self._left_out = 0

    def add(self, chunk: bytes) -> None:
        """Take in the next bytes."""
        head = chunk[: self._room]
        if head:
            self._write(head)
            self._room -= len(head)
        rest = self._tail + chunk[len(head) :]
        self._tail = rest[-TAIL:]
        self._left_out += len(rest) - len(self._tail)

    def close(self) -> None:
        """Write the end of an output that did not fit, and how much is missing before it."""
        if self._left_out:
            self._write(f"\n[{self._left_out:,} bytes of output left out here]\n".encode())
        if self._tail:
            self._write(self._tail)
        self._tail = b""
