"""The page that shows the score of a run and nothing else."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from agentflow.report.page import write_page
from agentflow.runs import read_result


def plain_report(path: Path, out: Path, **_: Any) -> Path:
    """Write it."""
    write_page(out, "A score", {"kind": "plain", "score": read_result(path).score})
    return out
