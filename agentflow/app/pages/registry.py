"""The registry of pages for `agentflow report`. Importing it loads no page."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

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
