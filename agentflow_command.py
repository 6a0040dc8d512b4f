"""Starts the command `agentflow`, from outside the package.

The package index has another distribution, called `agentflow`. Its package has the name of ours: it
overwrites files of ours or, where ours is an editable installation, hides all of them.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable
from contextlib import suppress

import agentflow

RECORDS = (".dist-info", ".egg-info")
"""How the folders end in which installers note what they installed."""
USAGE = 2


def main() -> int:
    """Run the command; first report another distribution that shares the package's folder."""
    other = namesake(os.listdir(os.path.dirname(next(iter(agentflow.__path__)))))
    if other:
        with suppress(OSError, ValueError):  # stderr is closed
            print(warning(other), file=sys.stderr, flush=True)
    try:
        from agentflow.cli import main as run
    except ModuleNotFoundError as error:
        if other and error.name == "agentflow.cli":
            return USAGE
        raise
    return run()


def namesake(beside: Iterable[str]) -> str:
    """The name and version of another distribution among the files beside a package, or ""."""
    for name in beside:
        stem, kind = os.path.splitext(name)
        if kind in RECORDS and stem.lower().startswith("agentflow-"):
            return stem.replace("-", " ", 1)
    return ""


def warning(other: str) -> str:
    """One line: what is wrong, and what to run."""
    return (
        f"agentflow: another distribution, {other}, is installed in the same folder as "
        "agentflow-machines and replaces files of it: run pip uninstall agentflow, then "
        "pip install --force-reinstall --no-deps agentflow-machines (in a clone: -e . instead of "
        "the name)"
    )
