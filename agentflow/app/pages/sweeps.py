"""Reports of sweeps."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from agentflow.app.sweeps.registry import HUMAN, LAYOUT, MECHANISMS, VERIFIED, VIEWS
from agentflow.app.sweeps.tables import SweepResult, layout_table, read_sweep_result
from agentflow.app.sweeps.views import last_cell, variants
from agentflow.metrics.scores import Scores
from agentflow.report.page import require_writable, write_page
from agentflow.report.sweep import sweep_data


def sweep_report(path: Path, out: Path, **_: Any) -> Path:
    """Write the page of a sweep, finished or not, to a file."""
    require_writable(out)
    data = sweep_page_data(path)
    write_page(out, f"{data['title']} · agentflow", data)
    return out


def sweep_page_data(path: Path) -> dict[str, Any]:
    """The data of the page of a sweep, finished or not."""
    result = read_sweep_result(path)
    views = {name: make(result) for name, make in VIEWS.items() if name != LAYOUT}
    for name in (HUMAN, VERIFIED, MECHANISMS):
        if not any(row.values[-1] is not None for row in views[name].rows):
            del views[name]
    tables = [layout_table(result, published=bool(result.sweep.table.published)), *views.values()]
    return sweep_data(
        result.sweep.title, result.sweep.about, _spreads(result), tables, _runs(result)
    )


def _spreads(result: SweepResult) -> dict[tuple[str, str], Scores]:
    """Scores of the last stage by task and, where they differ, by model and variant."""
    groups = variants(result)
    differing = [len(set(parts)) > 1 for parts in zip(*groups, strict=True)][1:]
    found = {}
    for (task, *rest), runs in groups.items():
        named = [part for part, differs in zip(rest, differing, strict=True) if differs]
        found[task, ", ".join(named)] = last_cell(result, runs).scores
    return found


def _runs(result: SweepResult) -> list[dict[str, Any]]:
    """Every run of the sweep: finished with its best score, failed with its reason, or missing."""
    done = [
        {
            "name": run.planned.name,
            "state": "done",
            "score": run.result.score,
            "verified": (found := run.numbers.record.verification) and found.score,
            "fragile": bool(found and found.holding and found.holding.fragile),
        }
        for run in result.finished
    ]
    return done + [
        {
            "name": name,
            "state": "failed" if name in result.failed else "missing",
            "score": None,
            "verified": None,
            "fragile": False,
            "why": result.failed.get(name, ""),
        }
        for name in result.missing
    ]
