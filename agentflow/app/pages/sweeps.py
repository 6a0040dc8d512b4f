"""Owns reports of sweeps: which tables and which scores their page shows."""

from __future__ import annotations

from pathlib import Path

from agentflow.app.pages.runs import ready, write
from agentflow.app.sweeps.tables import Swept, read_swept
from agentflow.app.sweeps.views import LAYOUT, VIEWS, last_cell, variants
from agentflow.metrics.scores import Scores
from agentflow.report.page import page
from agentflow.report.sweep import sweep_data


def sweep_report(path: Path, out: Path) -> Path:
    """Write the page of a sweep, done or not.

    Args:
        path: The sweep's folder.
        out: The file.

    Raises:
        RunError: Nothing of the sweep is done, or it is damaged.
        UsageError: The file cannot be written; the page's bundle or scipy is missing.
    """
    ready(out)
    swept = read_swept(path)
    views = dict(VIEWS)
    tables = [views.pop(LAYOUT)(swept), *(view(swept) for view in views.values())]
    data = sweep_data(swept.sweep.title, swept.sweep.about, _spreads(swept), tables)
    write(out, page(f"{swept.sweep.title} · agentflow", data))
    return out


def _spreads(swept: Swept) -> dict[str, Scores]:
    """Scores of the last stage by task, model and variant, named by what differs among them."""
    groups = variants(swept)
    differing = [len(set(parts)) > 1 for parts in zip(*groups, strict=True)]
    found = {}
    for key, runs in groups.items():
        named = [part for part, differs in zip(key, differing, strict=True) if differs]
        found[", ".join(named) or ", ".join(filter(None, key))] = last_cell(swept, runs).scores
    return found
