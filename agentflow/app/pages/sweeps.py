"""Owns reports of sweeps: which tables and which scores their page shows."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from agentflow.app.pages.runs import ready, write
from agentflow.app.sweeps.tables import Swept, layout, read_swept
from agentflow.app.sweeps.views import LAYOUT, PLAYERS, VIEWS, last_cell, variants
from agentflow.metrics.scores import Scores
from agentflow.report.page import page
from agentflow.report.sweep import sweep_data
from agentflow.runs import read_result


def sweep_report(path: Path, out: Path, **_: Any) -> Path:
    """Write the page of a sweep, done or not.

    Args:
        path: The sweep's folder.
        out: The file.

    Raises:
        RunError: Nothing of the sweep is done, or it is damaged.
        UsageError: The file cannot be written; the page's bundle is missing.
    """
    ready(out)
    swept = read_swept(path)
    views = {name: make(swept) for name, make in VIEWS.items() if name != LAYOUT}
    if not any(row.values[-1] is not None for row in views[PLAYERS].rows):
        del views[PLAYERS]
    tables = [layout(swept, published=bool(swept.sweep.table.published)), *views.values()]
    data = sweep_data(swept.sweep.title, swept.sweep.about, _spreads(swept), tables, _runs(swept))
    write(out, page(f"{swept.sweep.title} · agentflow", data))
    return out


def _spreads(swept: Swept) -> dict[tuple[str, str], Scores]:
    """Scores of the last stage by task and by what else differs: model, variant."""
    groups = variants(swept)
    differing = [len(set(parts)) > 1 for parts in zip(*groups, strict=True)][1:]
    found = {}
    for (task, *rest), runs in groups.items():
        named = [part for part, differs in zip(rest, differing, strict=True) if differs]
        found[task, ", ".join(named)] = last_cell(swept, runs).scores
    return found


def _runs(swept: Swept) -> list[dict[str, Any]]:
    """Every run of the sweep: done with its best score, failed with its reason, or missing."""
    done = [
        {"name": run.member.name, "state": "done", "score": read_result(run.path)["score"]}
        for run in swept.runs
    ]
    return done + [
        {"name": name, "state": "failed" if name in swept.failed else "missing", "score": None}
        | {"why": swept.failed.get(name, "")}
        for name in swept.missing
    ]
