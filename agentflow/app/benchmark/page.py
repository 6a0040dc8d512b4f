"""The page of a leaderboard."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from statistics import fmean
from typing import Any

from agentflow.app.benchmark.card import LONG, PARTS, CountedMachine, Point, Scorecard
from agentflow.app.benchmark.leaderboard import leaderboard, shown_parts
from agentflow.app.pages.films import Shapes, machine_data
from agentflow.env.tasks.registry import known_title, known_unit
from agentflow.machine import read_machine
from agentflow.machine.blocks.library import library
from agentflow.metrics.tables import counted
from agentflow.report.page import require_writable, write_page
from agentflow.report.sweep import PLAIN, table_data


def leaderboard_page(cards: Sequence[Scorecard], out: Path, told: Sequence[str] = ()) -> Path:
    """Write the leaderboard of scorecards, best first, to an HTML file."""
    require_writable(out)
    write_page(out, "Leaderboard · agentflow", leaderboard_data(cards, told))
    return out


def leaderboard_data(cards: Sequence[Scorecard], told: Sequence[str] = ()) -> dict[str, Any]:
    """The data of the page of a leaderboard; `told` are further notes.

    It shows the machines that count in the first part as built, by content hash.
    """
    tables = leaderboard(cards, told)
    shown = {"model", "complete", "total", "families"}
    items, each = len(cards[0].items), len(cards[0].items) / len(cards[0].families)
    shapes, machines = Shapes(), dict[str, dict[str, Any]]()
    return {
        "kind": "leaderboard",
        "title": tables[0].title,
        "engine": cards[0].conditions["engine"],
        "about": f"{counted(len(cards), 'model')} on {counted(items, 'item')}, {each:g} per family",
        "pars": "pars" in cards[0].conditions,
        "tables": [table_data(table, words={**PLAIN, **PARTS}, zeros=True) for table in tables],
        "parts": (parts := shown_parts(cards[0])),
        "words": {part: PARTS.get(part, part) for part in parts},
        "cards": [
            {
                **card.model_dump(mode="json", include=shown),
                "outcomes": {
                    part: Counter(each.outcome for item in card.items for each in item.parts[part])
                    for part in card.parts
                },
                "course": _course(card),
                "items": [
                    {
                        "item": item.item,
                        "title": known_title(item.task),
                        "about": ", ".join(
                            [item.task, *(f"{knob} {value}" for knob, value in item.knobs.items())]
                        ),
                        "share": item.share(card.ranked),
                        "score": (best := _best(item.parts[card.ranked])).score,
                        "full": item.full,
                        "unit": known_unit(item.task),
                        "machine": _shown(best, shapes, machines),
                    }
                    for item in card.items
                ],
            }
            for card in cards
        ],
        "machines": machines,
        **shapes.data,
    }


def _best(counted: Sequence[CountedMachine]) -> CountedMachine:
    return max(counted, key=lambda one: -1.0 if one.share is None else one.share)


def _shown(best: CountedMachine, shapes: Shapes, machines: dict[str, dict[str, Any]]) -> str | None:
    """The content hash of a machine, which is added to `machines`; None without one."""
    machine = read_machine(best.machine, library()).machine
    if machine is None:
        return None
    if machine.digest not in machines:
        machines[machine.digest] = machine_data(machine, None, shapes)
    return machine.digest


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
