"""Galleries: the best machines of several runs on one page, with films."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from agentflow.app.design.execution import best_machine
from agentflow.app.design.plan import task_of_run
from agentflow.app.pages.films import Shapes
from agentflow.app.pages.runs import (
    FINE,
    ReportedMachine,
    film_machines,
    task_summary,
    thumbnail,
)
from agentflow.config.run import build_config
from agentflow.env.tasks.records import record_json
from agentflow.errors import RunError
from agentflow.progress import Progress
from agentflow.report.page import require_writable, write_page
from agentflow.runs import find_runs, read_document, read_result, state_of

Run = tuple[dict[str, Any], ReportedMachine | None]
"""The data of a run's card, and the best machine that it found."""


def gallery(folders: Sequence[Path], out: Path, *, workers: int, say: Progress) -> Path:
    """Write one page with the best machine of each run, by task, best verified score first.

    The page names the physics engine in its title, or on each card if there are several.

    Args:
        folders: Run directories, or folders that contain some; unfinished runs are skipped.
        out: File to write.
        workers: Worker processes for simulation.
        say: Receives progress.
    """
    require_writable(out)
    paths = [path for folder in folders for path in _finished_runs(folder)]
    runs = _sort_by_task([_read_run(path) for path in paths])
    engines = list(dict.fromkeys(card["engine"] for card, _ in runs if card["engine"]))
    if len(engines) > 1:
        runs = [({**card, "about": f"{card['about']}, {card['engine']}"}, m) for card, m in runs]
    shapes = Shapes()
    chosen = {str(place): best for place, (_, best) in enumerate(runs) if best is not None}
    machines = asyncio.run(film_machines(chosen, shapes, workers, say))
    data = {
        "kind": "gallery",
        "title": " · ".join(["Machines", *engines] if len(engines) == 1 else ["Machines"]),
        **shapes.data,
        "machines": machines,
        "cards": [{"machine": str(place), **card} for place, (card, _) in enumerate(runs)],
    }
    write_page(out, "Machines · agentflow", data)
    return out


def _finished_runs(folder: Path) -> list[Path]:
    found = [path for path in find_runs(folder) if state_of(path) == "done"]
    if not found:
        raise RunError(
            f"{folder} contains no finished run: expected a run directory or a folder with runs"
        )
    return found


def _sort_by_task(runs: Sequence[Run]) -> list[Run]:
    """Runs by task; the best verified score first, or score where there is no verified one."""

    def order(run: Run) -> tuple[str, float]:
        card, _ = run
        score = card["score"] if card["verified"] is None else card["verified"]
        return card["task"], -(float("-inf") if score is None else score)

    return sorted(runs, key=order)


def _read_run(path: Path) -> Run:
    document, result = read_document(path), read_result(path)
    config = build_config(document.get("config"))
    machine, best, picture = best_machine(result), None, None
    if machine is not None:
        best = ReportedMachine.of(path, document, machine, result.score, FINE)
        picture = thumbnail(best)
    card = {
        "task": config.task,
        "asked": task_summary(path, document),
        "about": f"{config.workflow}, {result.model}, seed {config.seed}",
        "engine": document.get("engine"),
        "run": path.name,
        "score": result.score,
        "verified": result.verified_score,
        "fragile": bool(result.fragile),
        "record": record_json(task_of_run(path, document), result.trusted_score),
        "why": "" if best else result.reason or "no valid machine was found",
        "picture": picture,
    }
    return card, best
