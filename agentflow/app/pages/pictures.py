"""Pictures, films and 3D files of a run or a machine file."""

from __future__ import annotations

from pathlib import Path

from agentflow.app.design.plan import task_of_run
from agentflow.app.design.results import read_finished
from agentflow.app.machines.files import machine_text
from agentflow.config.run import build_config
from agentflow.env.drawing.film import save_film
from agentflow.env.drawing.gltf import rollout_glb
from agentflow.env.drawing.stills import render_png
from agentflow.env.rollout import Rollout
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.base import Task
from agentflow.errors import RunError, UnknownNameError, UsageError
from agentflow.files import write_output
from agentflow.machine import Machine, check, library, read_machine
from agentflow.machine.formats.detect import read_any
from agentflow.runs import read_document

STILL, GIF, MP4, GLB = ".png", ".gif", ".mp4", ".glb"
SAMPLES = {GIF: 10, MP4: 20, GLB: 20}
"""Samples per second of moving formats."""
NAMES = {STILL: "picture", GIF: "film", MP4: "film", GLB: "model"}
SIZES = {GIF: (480, 360), MP4: (640, 480)}


def render_run(path: Path, out: Path | None = None, view: str = "three-quarter") -> dict[str, str]:
    """Draw or film the best machine of a finished run: `out`, by default best.png and best.gif."""
    result, document = read_finished(path), read_document(path)
    seed = build_config(document.get("config")).seed
    machine = read_machine(result["machine"], range(1000)).machine
    if machine is None:
        raise RunError(f"{path} has no valid machine to draw")
    return _render(machine, task_of_run(path, document), seed, out or path / "best", view)


def render_file(source: str, task: Task, seed: int, out: Path, view: str) -> dict[str, str]:
    """Draw or film the machine of a file, depending on the suffix of `out`; both without one."""
    report = check(read_any(machine_text(source), blocks=tuple(library())))
    if report.machine is None or not report.machine_valid:
        raise UsageError(f"{source} cannot be built: {report.problems[0].message}")
    return _render(report.machine, task, seed, out, view)


def _render(machine: Machine, task: Task, seed: int, out: Path, view: str) -> dict[str, str]:
    if not out.name:
        raise UsageError(f"--out takes a file name, not {str(out)!r}")
    files = [out] if out.suffix else [out.with_suffix(GIF), out.with_suffix(STILL)]
    for file in files:
        with write_output(file) as part:
            _write(machine, task, seed, part, view)
    return {NAMES[file.suffix.lower()]: str(file) for file in reversed(files)}


def _write(machine: Machine, task: Task, seed: int, file: Path, view: str) -> None:
    kind = file.suffix.lower()
    if kind == STILL:
        render_png(machine, file, view=view)
    elif kind in SAMPLES:
        rollout = _simulate(machine, task, seed, 1.0 / SAMPLES[kind])
        if kind == GLB:
            file.write_bytes(rollout_glb(machine, rollout))
        else:
            save_film(machine, task, rollout, file, size=SIZES[kind])
    else:
        raise UnknownNameError("kind of picture", kind, (STILL, *SAMPLES))


def _simulate(machine: Machine, task: Task, seed: int, interval: float) -> Rollout:
    rollout = simulate(machine, task, seed=seed, interval=interval, recorded=True)
    if rollout.trace is None:
        why = "; ".join(str(problem["message"]) for problem in rollout.problems)
        raise UsageError(f"nothing to film: the rollout ended with status {rollout.status} ({why})")
    return rollout
