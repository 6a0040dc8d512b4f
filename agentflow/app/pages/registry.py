"""The registry of pages that `agentflow report` writes. Importing it loads none of them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from agentflow.registry import Registry


class Page(Protocol):
    """Writes a page; returns the file."""

    def __call__(
        self, path: Path, out: Path, *, films: int, workers: int, say: Callable[[int, int], None]
    ) -> Path:
        """Write it.

        Args:
            path: Run directory or sweep directory.
            out: The file.
            films: Most machines to film.
            workers: Processes that simulate them.
            say: Called with the numbers of finished and of all simulations.
        """


PAGES: Registry[Page] = Registry(
    "page",
    "agentflow.pages",
    {
        "run": "agentflow.app.pages.runs:report",
        "sweep": "agentflow.app.pages.sweeps:sweep_report",
    },
    lambda _, thing: "" if callable(thing) else "is not a function",
)
