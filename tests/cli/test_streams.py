"""Output that nobody reads to its end, or at all, is no error."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

from agentflow.cli.display.text import describe_os_error

AGENTFLOW = f'"{sys.executable}" -c "import sys; from agentflow.cli import main; sys.exit(main())"'
INTERRUPTED = """
import signal, sys
from agentflow.cli import main
signal.signal(signal.SIGALRM, signal.default_int_handler)  # as Ctrl-C, while input is waited for
signal.setitimer(signal.ITIMER_REAL, 1.0)
sys.exit(main(["check", "-"]))
"""


@pytest.mark.parametrize(
    ("command", "status"),
    [
        (f"{AGENTFLOW} blocks >&-", 0),
        (f"{AGENTFLOW} blocks nothing >&- 2>&-", 2),
        (f"set -o pipefail; {AGENTFLOW} prompts show | true", 0),
        (f"set -o pipefail; {AGENTFLOW} blocks | true", 0),
    ],
)
@pytest.mark.slow
def test_nobody_need_read(command: str, status: int) -> None:
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (status, "", "")


@pytest.mark.slow
def test_output_that_cannot_be_written_is_told() -> None:
    command = f"{AGENTFLOW} blocks >/dev/full"
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True)
    told = "agentflow: cannot write the output: No space left on device\n"
    assert (done.returncode, done.stderr) == (2, told)


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (OSError(errno.ENOSPC, "No space left on device"), "cannot write the output: No space"),
        (OSError(errno.EROFS, "Read-only file system", "a"), "cannot write a: Read-only file"),
        (
            PermissionError(errno.EACCES, "Permission denied", "a"),
            "cannot use a: Permission denied",
        ),
        (OSError(errno.EXDEV, "Invalid link", "a", None, "b"), "cannot use b: Invalid link"),
        (OSError(errno.EMFILE, "Too many open files"), "system error: Too many open files"),
        (TimeoutError("slow"), "system error: slow"),
    ],
)
def test_what_the_system_refuses_is_said_of_what_it_refused(error: OSError, words: str) -> None:
    assert describe_os_error(error).startswith(words)


def test_a_group_alone_says_what_it_holds() -> None:
    done = subprocess.run(["bash", "-c", f"{AGENTFLOW} prompts"], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("Usage: agentflow prompts [OPTIONS] COMMAND [ARGS]...\n")
    assert "  diff  Compare the templates of two prompt sets.\n" in done.stderr
    assert done.stderr.endswith("Example: agentflow prompts show --role designer --task throwing\n")


@pytest.mark.slow
def test_an_interruption_is_told_in_one_line() -> None:
    process = subprocess.Popen(
        [sys.executable, "-c", INTERRUPTED],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    assert process.wait(30) == 130
    assert process.communicate() == (b"", b"agentflow: interrupted\n")


@pytest.mark.pybullet
@pytest.mark.skipif(os.name != "posix", reason="closes a descriptor in a shell")
def test_a_closed_stderr_is_no_obstacle() -> None:
    machine = Path(__file__).parents[2] / "examples" / "car.json"
    command = f"simulate {machine} --task movement --engine pybullet"
    done = subprocess.run(
        ["sh", "-c", f"{AGENTFLOW} {command} 2>&-"],
        stdout=subprocess.PIPE,
        timeout=120,
        text=True,
    )
    assert done.returncode == 0
    assert done.stdout.startswith("ok, score")
