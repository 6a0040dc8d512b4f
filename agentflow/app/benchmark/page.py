"""The page of a leaderboard."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from agentflow.app.benchmark.card import Scorecard
from agentflow.app.benchmark.leaderboard import leaderboard
from agentflow.report.page import require_writable, write_page
from agentflow.report.sweep import sweep_data


def leaderboard_page(cards: Sequence[Scorecard], out: Path, told: Sequence[str] = ()) -> Path:
    """Write the leaderboard of scorecards, best first, to an HTML file."""
    require_writable(out)
    write_page(out, "Leaderboard · agentflow", leaderboard_data(cards, told))
    return out


def leaderboard_data(cards: Sequence[Scorecard], told: Sequence[str] = ()) -> dict[str, Any]:
    """The data of the page of a leaderboard; `told` are further notes."""
    tables = leaderboard(cards, told)
    shown = {"model", "complete", "total", "families"}
    return {
        **sweep_data("Leaderboard", tables[0].title, {}, tables, zeros=True),
        "kind": "leaderboard",
        "cards": [
            {
                **card.model_dump(mode="json", include=shown),
                "first": Counter(each.outcome for item in card.items for each in item.first),
                "refined": Counter(item.refined.outcome for item in card.items),
            }
            for card in cards
        ],
    }
