"""Programs end on their own, at their limit or when cancelled, with all their children."""

from __future__ import annotations

import asyncio
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from agentflow.errors import RunError
from agentflow.integrations.external.process import HEAD, TAIL, Ending, ProgramCommand, run_program

pytestmark = pytest.mark.skipif(os.name != "posix", reason="sessions and signals")

MARK = "AGENT_TEST"
STUBBORN = """
import os, signal, sys, time
signal.signal(signal.SIGTERM, signal.SIG_IGN)
name = sys.argv[1]
open(name + ".part", "w").write(str(os.getpid()))
os.rename(name + ".part", name)
time.sleep(600)
"""
"""Writes its process id to the file that it is named after, and ignores SIGTERM."""
FAMILY = f"""
import os, subprocess, sys, time
code = {STUBBORN!r}
subprocess.Popen([sys.executable, "-c", code, "child"])
subprocess.Popen([sys.executable, "-c", code, "session"], start_new_session=True)
if os.fork() == 0:  # a daemon: its parent is gone and its session its own
    os.setsid()
    if os.fork() == 0:
        os.execv(sys.executable, [sys.executable, "-c", code, "daemon"])
    os._exit(0)
names = ["child", "session", "daemon"]
while not all(map(os.path.exists, names)):
    time.sleep(0.01)
open("ready", "w").close()
"""
"""Starts three stubborn children: its own, one in another session, a daemon."""
WAIT = "\nimport time; time.sleep(600)"


def command(code: str, limit: float = 60.0, grace: float = 0.3) -> ProgramCommand:
    variables = {"PATH": os.environ["PATH"], MARK: f"{os.getpid()}-{time.monotonic_ns()}"}
    return ProgramCommand([sys.executable, "-c", code], variables, MARK, limit, grace)


def run(code: str, folder: Path, limit: float = 60.0, grace: float = 0.3) -> tuple[Ending, bytes]:
    written: list[bytes] = []
    given = folder / "given"
    given.write_text("what to do")
    ending = asyncio.run(run_program(command(code, limit, grace), folder, given, written.append))
    return ending, b"".join(written)


@pytest.fixture
def family(tmp_path: Path) -> Iterator[list[Path]]:
    """The files in which three stubborn children write who they are; killed after a failed test."""
    files = [tmp_path / name for name in ("child", "session", "daemon")]
    yield files
    for file in files:
        if file.exists() and lives(file):
            os.kill(int(file.read_text()), 9)


def lives(file: Path) -> bool:
    """Whether the process whose id is in a file goes on; one that was killed needs a moment."""
    deadline = time.monotonic() + 5.0
    while runs(file.read_text()):
        if time.monotonic() > deadline:
            return True
        time.sleep(0.01)
    return False


def runs(pid: str) -> bool:
    """Whether a process has not ended yet."""
    try:
        status = Path(f"/proc/{pid}/stat").read_text()
    except (FileNotFoundError, ProcessLookupError):
        return False
    return status.rpartition(")")[2].split()[0] != "Z"


def test_output_and_exit_status_of_a_program_that_ends(tmp_path: Path) -> None:
    said = "print('on', file=sys.stderr); print(sys.stdin.read(), os.getcwd())"
    code = f"import os, sys; {said}; exit(3)"
    ending, written = run(code, tmp_path)
    assert (ending, written) == (
        Ending(3, timed_out=False),
        f"on\nwhat to do {tmp_path}\n".encode(),
    )


def test_it_gets_no_variable_but_those_of_the_command(tmp_path: Path) -> None:
    code = "import os; print(sorted(set(os.environ) - {'LC_CTYPE'}))"
    assert run(code, tmp_path)[1].decode().strip() == str([MARK, "PATH"])


def test_a_signal_is_a_negative_status(tmp_path: Path) -> None:
    ending, _ = run("import os; os.kill(os.getpid(), 9)", tmp_path)
    assert ending == Ending(-9, timed_out=False)


@pytest.mark.slow
def test_the_limit_first_asks_a_program_to_end(tmp_path: Path) -> None:
    code = "import signal, sys; signal.signal(15, lambda *_: sys.exit(7)); print('on', flush=True)"
    ending, written = run(code + WAIT, tmp_path, limit=5.0, grace=30.0)
    assert (ending, written) == (Ending(7, timed_out=True), b"on\n")


@pytest.mark.slow
def test_no_child_outlives_its_program(tmp_path: Path, family: list[Path]) -> None:
    ending, _ = run(FAMILY, tmp_path)
    assert ending == Ending(0, timed_out=False)
    assert [lives(file) for file in family] == [False, False, False]


@pytest.mark.slow
def test_no_child_outlives_a_program_that_is_stopped_at_its_limit(
    tmp_path: Path, family: list[Path]
) -> None:
    ending, _ = run(FAMILY + WAIT, tmp_path, limit=7.0)
    assert ending == Ending(-15, timed_out=True)
    assert [lives(file) for file in family] == [False, False, False]


@pytest.mark.slow
@pytest.mark.parametrize("request_", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_no_child_outlives_an_interrupted_process(
    tmp_path: Path, family: list[Path], request_: signal.Signals
) -> None:
    running = interruptible(tmp_path, FAMILY + WAIT)
    while not (tmp_path / "ready").exists():
        assert running.poll() is None
        time.sleep(0.01)
    running.send_signal(request_)
    _, told = running.communicate(timeout=60)
    assert told.rstrip().endswith("KeyboardInterrupt")
    assert [lives(file) for file in family] == [False, False, False]


@pytest.mark.parametrize("request_", [signal.SIGTERM, signal.SIGHUP])
def test_a_second_request_to_end_kills_at_once(tmp_path: Path, request_: signal.Signals) -> None:
    stubborn = f"import sys; sys.argv[1:] = ['child']\n{STUBBORN}"
    running = interruptible(tmp_path, stubborn, grace=600.0)
    while not (tmp_path / "child").exists():
        time.sleep(0.01)
    for _ in range(2):
        running.send_signal(request_)
        time.sleep(0.2)
    _, told = running.communicate(timeout=60)
    assert told.rstrip().endswith("KeyboardInterrupt")
    assert not lives(tmp_path / "child")


def test_a_request_to_end_while_the_program_starts(tmp_path: Path) -> None:
    begin = "open('child', 'w').write(str(os.getpid()))"
    at_start = "asyncio.get_running_loop().call_soon(os.kill, os.getpid(), signal.SIGTERM)"
    running = interruptible(tmp_path, f"import os; {begin}{WAIT}", before=at_start)
    _, told = running.communicate(timeout=60)
    assert told.rstrip().endswith("KeyboardInterrupt")
    assert not (tmp_path / "child").exists() or not lives(tmp_path / "child")


def interruptible(
    folder: Path, code: str, *, grace: float = 0.3, before: str = "pass"
) -> subprocess.Popen[str]:
    """A process that runs a program, just after a statement."""
    (folder / "given").touch()
    text = f"""
import asyncio, os, pathlib, signal
from agentflow.integrations.external import process
folder = pathlib.Path({str(folder)!r})
command = process.{command(code, grace=grace)!r}
async def run():
    {before}
    await process.run_program(command, folder, folder / "given", print)
asyncio.run(run())
"""
    return subprocess.Popen([sys.executable, "-c", text], stderr=subprocess.PIPE, text=True)


@pytest.mark.slow
def test_no_child_outlives_a_cancelled_program(tmp_path: Path, family: list[Path]) -> None:
    (tmp_path / "given").touch()

    async def cancel_it() -> None:
        given = tmp_path / "given"
        running = run_program(command(FAMILY + WAIT), tmp_path, given, lambda _bytes: None)
        task = asyncio.ensure_future(running)
        while not (tmp_path / "ready").exists():
            await asyncio.sleep(0.01)
        assert all(runs(file.read_text()) for file in family)
        task.cancel()
        await task

    with pytest.raises(asyncio.CancelledError):
        asyncio.run(cancel_it())
    assert [lives(file) for file in family] == [False, False, False]


def test_a_flood_of_output_is_cut_in_the_middle(tmp_path: Path) -> None:
    code = """
import os
for number in range(320):  # 20 MiB
    os.write(1, b"%07d\\n" % number * 8192)
os.write(1, b"the end")
"""
    _, written = run(code, tmp_path)
    left_out = 320 * (1 << 16) + 7 - HEAD - TAIL
    note = f"\n[{left_out:,} bytes of output left out here]\n".encode()
    assert len(written) == HEAD + len(note) + TAIL
    assert written.startswith(b"0000000\n")
    assert written[HEAD:].startswith(note)
    assert written.endswith(b"0000319\nthe end")


def test_an_output_that_just_fits_is_whole(tmp_path: Path) -> None:
    _, written = run(f"import os; os.write(1, b'x' * {HEAD + TAIL})", tmp_path)
    assert written == b"x" * (HEAD + TAIL)


def test_a_log_that_cannot_be_written_stops_the_program(tmp_path: Path) -> None:
    given = tmp_path / "given"
    given.touch()

    def fail(_data: bytes) -> None:
        raise RunError("the disk is full")

    with pytest.raises(RunError, match="the disk is full"):
        asyncio.run(run_program(command("print(1, flush=True)" + WAIT), tmp_path, given, fail))


def test_a_program_that_cannot_be_started(tmp_path: Path) -> None:
    given = tmp_path / "given"
    given.touch()
    missing = ProgramCommand(["/nowhere/agent"], {MARK: "1"}, MARK, 1.0)
    with pytest.raises(FileNotFoundError):
        asyncio.run(run_program(missing, tmp_path, given, lambda _bytes: None))
