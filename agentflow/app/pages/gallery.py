"""Owns galleries: the machines that runs have found, on one page with their films."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from agentflow.app.design.results import read_finished
from agentflow.app.pages.films import Shapes
from agentflow.app.pages.runs import (
    FINE,
    Say,
    Shown,
    asked,
    best_of,
    exhibits,
    kept_rollout,
    ready,
    write,
)
from agentflow.config.run import build
from agentflow.env.drawing.stills import png_url
from agentflow.env.tasks.registry import get_task
from agentflow.errors import RunError
from agentflow.machine import library, read_machine
from agentflow.report.page import page
from agentflow.runs import find_runs, read_document, state_of

THUMBNAIL = (320, 240)


@dataclass(frozen=True)
class Hung:
    """One finished run of a gallery."""

    path: Path
    task: str
    about: str
    asked: dict[str, Any]
    """What the task asks, as pages show it."""
    score: float | None
    why: str
    """Why it found no machine; "" where it did."""
    shown: Shown | None
    """Its machine; None where it found none."""


def gallery(folders: Sequence[Path], out: Path, *, workers: int, say: Say) -> Path:
    """Write one page of the machines that runs have found, by task, the best ones first.

    Args:
        folders: Run directories, or folders that hold some; unfinished runs are left out.
        out: The file.
        workers: Processes that simulate them.
        say: Told of the progress.

    Raises:
        RunError: There is no finished run, or one is damaged.
        UsageError: The file cannot be written, or the page's bundle is missing.
    """
    ready(out)
    runs = _ordered([_hung(path) for folder in folders for path in _finished_runs(folder)])
    shapes = Shapes()
    chosen = {str(place): run.shown for place, run in enumerate(runs) if run.shown is not None}
    machines = asyncio.run(exhibits(chosen, shapes, workers, say))
    data = {
        "kind": "gallery",
        "title": "Machines",
        "shapes": shapes.rows,
        "machines": machines,
        "cards": [_card(str(place), run) for place, run in enumerate(runs)],
    }
    write(out, page("Machines · agentflow", data))
    return out


def _finished_runs(folder: Path) -> Iterator[Path]:
    found = [path for path in find_runs(folder) if state_of(path) == "done"]
    if not found:
        raise RunError(f"{folder} holds no finished run: expected a run directory, or runs in it")
    yield from found


def _ordered(runs: Sequence[Hung]) -> list[Hung]:
    """The runs of a task together, tasks as they come first, the best runs before the others."""
    tasks = list(dict.fromkeys(run.task for run in runs))
    worst = float("-inf")
    return sorted(
        runs,
        key=lambda run: (tasks.index(run.task), -(worst if run.score is None else run.score)),
    )


def _hung(path: Path) -> Hung:
    document, result = read_document(path), read_finished(path)
    config = build(document.get("config"))
    digest = best_of(result)
    about = f"{config.workflow}, {result['model']}, seed {config.seed}"
    shown = None
    if digest is not None:
        machine = read_machine(result["machine"], library()).machine
        assert machine is not None, "it has a content hash"
        shown = Shown(
            machine=machine,
            task=get_task(config.task, config.knobs),
            seed=config.seed,
            score=result["score"],
            interval=FINE,
            kept=kept_rollout(path, document, digest),
        )
    why = "" if shown is not None else str(result.get("reason") or "no valid machine was found")
    return Hung(path, config.task, about, asked(config), result["score"], why, shown)


def _card(key: str, run: Hung) -> dict[str, Any]:
    picture = None
    if run.shown is not None:
        picture = png_url(run.shown.machine, view="three-quarter", size=THUMBNAIL)
    return {
        "machine": key,
        "task": run.task,
        "asked": run.asked,
        "about": run.about,
        "run": run.path.name,
        "score": run.score,
        "why": run.why,
        "picture": picture,
    }
