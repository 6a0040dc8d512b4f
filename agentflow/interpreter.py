"""Fresh Python processes, which find modules where this one does and never in the current folder.

The current folder may hold what somebody else has sent: a `numpy.py` in a received run must not run
because a worker was started there.
"""

import os
import sys

_PRELUDE = "import sys; sys.path = [place for place in sys.path if place]\n"
"""Comes before any other import: `python -c` puts the current folder first, as an empty text.
`-P` would do the same from Python 3.11 on."""


def python_command(program: str, *arguments: str) -> list[str]:
    """The command line of an interpreter that runs a program, given as text."""
    return [sys.executable, "-c", _PRELUDE + program, *arguments]


def python_environment() -> dict[str, str]:
    """The variables of this process; modules are sought where it seeks them.

    An empty place in this list would be the current folder of the new process.
    """
    return {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
