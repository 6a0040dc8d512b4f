"""Owns the pictures of a machine and of its rollout, for a run or a machine file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from agentflow.app.machines import machine_text
from agentflow.config import build
from agentflow.env.render import render_gif, render_png
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.registry import get_task
from agentflow.errors import RunError, UsageError
from agentflow.machine import Machine, check, read_machine
from agentflow.runs import read_document, read_result


def render_run(path: Path) -> dict[str, str]:
    """Write best.png and best.gif of a finished run into its folder.

    Raises:
        RunError: The run is unfinished, or found no valid machine.
    """
    result: dict[str, Any] = read_result(path)
    config = build(read_document(path)["config"])
    machine = read_machine(result["machine"], range(1000)).machine
    if machine is None:
        raise RunError(f"{path} found no valid machine to draw")
    return _render(machine, get_task(config.task, config.knobs), config.seed, path / "best")


def render_file(source: str, task: Task, seed: int, stem: Path) -> dict[str, str]:
    """Write `stem`.png and `stem`.gif of a machine file.

    Raises:
        UsageError: The machine cannot be built; names the first problem.
    """
    report = check(machine_text(source), task.brief)
    if report.machine is None or not report.task_valid:
        raise UsageError(f"{source} cannot be built: {report.problems[0].message}")
    return _render(report.machine, task, seed, stem)


def _render(machine: Machine, task: Task, seed: int, stem: Path) -> dict[str, str]:
    picture, film = stem.with_suffix(".png"), stem.with_suffix(".gif")
    try:
        render_png(machine, picture)
        render_gif(machine, task, film, seed=seed)
    except OSError as error:
        raise UsageError(f"cannot write {stem}.*: {error.strerror}") from None
    return {"picture": str(picture), "film": str(film)}
