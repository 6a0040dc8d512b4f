"""The registry of pages for `agentflow report`. Importing it loads no page."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from agentflow.errors import RunError
from agentflow.registry import Registry, is_callable

PAGES: Registry[Callable[..., Path]] = Registry(
    "page",
    "agentflow.pages",
    {
        "run": "agentflow.app.pages.runs:report",
        "sweep": "agentflow.app.pages.sweeps:sweep_report",
        "training": "agentflow.app.pages.training:training_report",
    },
    is_callable,
)
"""All take the arguments of `runs.report` and return the file."""


def page_of(path: Path) -> str:
    """The name of the page for a directory.

    Raises:
        RunError: It only holds directories that have a page; the message names one.
    """
    from agentflow.app.sweeps.folder import is_sweep
    from agentflow.runs import find_runs
    from agentflow.training.record import ABOUT

    if is_sweep(path):
        return "sweep"
    if (path / ABOUT).is_file():
        return "training"
    inside = [*find_runs(path), *(file.parent for file in sorted(path.rglob(ABOUT)))]
    if inside and path not in inside:
        raise RunError(
            f"{path} is not a run, a sweep or a training run, but holds some: give one of them, "
            f"such as {inside[0]}; agentflow table compares training runs"
        )
    return "run"
