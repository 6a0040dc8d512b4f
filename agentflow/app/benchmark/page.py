"""The page of a leaderboard."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from statistics import fmean
from typing import Any

from agentflow.app.benchmark.card import LONG, Point, Scorecard
from agentflow.app.benchmark.leaderboard import leaderboard, shown_parts
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
        "parts": shown_parts(cards[0]),
        "cards": [
            {
                **card.model_dump(mode="json", include=shown),
                "outcomes": {
                    part: Counter(each.outcome for item in card.items for each in item.parts[part])
                    for part in card.parts
                },
                "course": _course(card),
            }
            for card in cards
        ],
    }


def _course(card: Scorecard) -> list[tuple[int, float]]:
    """The mean share of the best machines so far, wherever it rises; [] if no part tells it."""
    courses = [
        one.course
        for item in card.items
        for one in item.parts.get(LONG, ())
        if one.area is not None
    ]
    moments = sorted({point.simulations for course in courses for point in course})

    def best(course: Sequence[Point], spent: int) -> float:
        return max((point.share for point in course if point.simulations <= spent), default=0.0)

    return [(spent, fmean(best(course, spent) for course in courses)) for spent in moments]
