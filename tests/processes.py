"""Python in another process, for what a test cannot show in its own."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

MAIN = "import sys; from agentflow.cli import main; sys.exit(main())"
"""The code of the command; its arguments follow."""


def run_python(
    *arguments: object, cwd: Path | None = None, status: int = 0, **variables: str
) -> subprocess.CompletedProcess[str]:
    """What Python with these arguments, and variables beside those of this process, writes.

    A test fails with that if the exit status is another one.
    """
    done = subprocess.run(
        [sys.executable, *map(str, arguments)],
        cwd=cwd, env={**os.environ, **variables}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == status, done.stdout + done.stderr
    return done
