"""The size of a run's best machine."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from agentflow.runs import read_result


def size_of(run: Path) -> dict[str, Any]:
    """Its number of blocks."""
    return {"run": str(run), "blocks": len(read_result(run).machine or ())}
