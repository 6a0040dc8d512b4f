"""The page of a leaderboard."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from agentflow.metrics.tables import Table
from agentflow.report.page import require_writable, write_page
from agentflow.report.sweep import sweep_data


def leaderboard_page(tables: Sequence[Table], out: Path) -> Path:
    """Write the tables of a leaderboard to an HTML file."""
    require_writable(out)
    title = "Leaderboard"
    write_page(out, f"{title} · agentflow", sweep_data(title, "", {}, tables))
    return out
