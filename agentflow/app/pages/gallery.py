"""Galleries: the best machines of several runs on one page, with films."""

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
    Progress,
    ReportedMachine,
    best_digest,
    film_machines,
    recorded_rollout,
    require_writable,
    task_summary,
    write_page,
)
from agentflow.config.run import build_config
from agentflow.env.drawing.stills import png_url
from agentflow.env.tasks.registry import get_task
from agentflow.errors import RunError
from agentflow.machine import library, read_machine
from agentflow.report.page import page
from agentflow.runs import find_runs, read_document, state_of

THUMBNAIL = (320, 240)


@dataclass(frozen=True)
class GalleryItem:
    """One finished run in a gallery."""

    path: Path
    task: str
    about: str
    asked: dict[str, Any]
    """From `task_summary`."""
    score: float | None
    why: str
    """Why it found no machine; "" if it found one."""
    shown: ReportedMachine | None
    """Its best machine."""


def gallery(folders: Sequence[Path], out: Path, *, workers: int, say: Progress) -> Path:
    """Write one page with the best machine of each run, by task, best first.

    Args:
        folders: Run directories, or folders that contain some; unfinished runs are skipped.
        out: The file.
        workers: Processes that simulate machines.
        say: Receives progress.

    Raises:
        RunError: There is no finished run, or one is damaged.
        UsageError: The file cannot be written, or the page's bundle is missing.
    """
    require_writable(out)
    runs = _sort_by_task(
        [_gallery_item(path) for folder in folders for path in _finished_runs(folder)]
    )
    shapes = Shapes()
    chosen = {str(place): run.shown for place, run in enumerate(runs) if run.shown is not None}
    machines = asyncio.run(film_machines(chosen, shapes, workers, say))
    data = {
        "kind": "gallery",
        "title": "Machines",
        "shapes": shapes.rows,
        "machines": machines,
        "cards": [_card(str(place), run) for place, run in enumerate(runs)],
    }
    write_page(out, page("Machines · agentflow", data))
    return out


def _finished_runs(folder: Path) -> Iterator[Path]:
    found = [path for path in find_runs(folder) if state_of(path) == "done"]
    if not found:
        raise RunError(
            f"{folder} holds no finished run: expected a run directory or a folder with runs"
        )
    yield from found


def _sort_by_task(runs: Sequence[GalleryItem]) -> list[GalleryItem]:
    """Runs grouped by task in order of first appearance, best first."""
    tasks = list(dict.fromkeys(run.task for run in runs))
    worst = float("-inf")
    return sorted(
        runs,
        key=lambda run: (tasks.index(run.task), -(worst if run.score is None else run.score)),
    )


def _gallery_item(path: Path) -> GalleryItem:
    document, result = read_document(path), read_finished(path)
    config = build_config(document.get("config"))
    digest = best_digest(result)
    about = f"{config.workflow}, {result['model']}, seed {config.seed}"
    shown = None
    if digest is not None:
        machine = read_machine(result["machine"], library()).machine
        assert machine is not None, "it has a content hash"
        shown = ReportedMachine(
            machine=machine,
            task=get_task(config.task, config.knobs),
            seed=config.seed,
            score=result["score"],
            interval=FINE,
            recorded=recorded_rollout(path, document, digest),
        )
    why = "" if shown is not None else str(result.get("reason") or "no valid machine was found")
    return GalleryItem(path, config.task, about, task_summary(config), result["score"], why, shown)


def _card(key: str, run: GalleryItem) -> dict[str, Any]:
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
