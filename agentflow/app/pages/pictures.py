"""Pictures, films and 3D files of a run or a machine file."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from pathlib import Path
from shlex import quote

from agentflow.app.machines.files import read_source
from agentflow.app.subjects.simulate import WORKERS, simulate_in_parallel
from agentflow.app.subjects.subject import Subject
from agentflow.env.drawing.film import save_film
from agentflow.env.drawing.gltf import rollout_glb
from agentflow.env.drawing.stills import render_png
from agentflow.env.physics.engines import choose_engine
from agentflow.env.rollout import Rollout
from agentflow.env.tasks.base import Task
from agentflow.errors import AgentflowError, RunError, UnknownNameError, UsageError
from agentflow.files.atomic import write_output
from agentflow.machine import check, library
from agentflow.progress import Progress, silent
from agentflow.runs import Listener, Notify
from agentflow.runs.events import DrawingEvent

STILL, GIF, MP4, GLB = ".png", ".gif", ".mp4", ".glb"
SAMPLES = {GIF: 10, MP4: 20, GLB: 20}
"""Samples per second of moving formats."""
NAMES = {STILL: "picture", GIF: "film", MP4: "film", GLB: "model"}
SIZES = {GIF: (480, 360), MP4: (640, 480)}


def render_run(
    path: Path,
    out: Path | None = None,
    view: str = "three-quarter",
    say: Progress = silent,
    engine: str | None = None,
) -> dict[str, str]:
    """Draw or film the best machine of a finished run: `out`, by default best.png and best.gif.

    Films show a simulation with `engine`, by default that of the run.
    """
    subject = Subject.of_run(path)
    if engine is not None:
        subject = subject.on(engine)
    return _Drawing(subject, view, say).save(out or path / "best")


def draw_missing(
    path: Path, listener: Listener | None = None, notify: Notify | None = None
) -> dict[str, str]:
    """The picture and the film of a finished run: kind -> path of each; what is there is kept.

    Args:
        path: The run directory.
        listener: Learns that something is drawn.
        notify: Receives why nothing can be drawn, in place of an error; the result is then {}.

    Raises:
        RunError: They cannot be drawn or written.
    """
    files = [path / f"best{suffix}" for suffix in (STILL, GIF)]
    missing = [file for file in files if not file.exists()]
    if missing and listener is not None:
        listener(DrawingEvent())
    try:
        for file in missing:
            render_run(path, file)
    except AgentflowError as error:
        told = (
            f"{error}; the run itself is complete: once this is repaired, draw its pictures with "
            f"agentflow design --resume {quote(str(path))}"
        )
        if notify is None:
            raise RunError(told) from error
        notify(told)
        return {}
    return {NAMES[file.suffix]: str(file) for file in files}


def render_file(
    source: str, task: Task, seed: int, out: Path, view: str, say: Progress, notify: Notify
) -> dict[str, str]:
    """Draw or film the machine of a file, depending on the suffix of `out`; both without one.

    An invalid machine is only drawn, with the blocks that overlap in red; `notify` gets the reason.
    """
    report = check(read_source(source, tuple(library())))
    if report.machine is None:
        raise UsageError(f"{source} cannot be built: {report.problems[0].message}")
    subject = Subject(report.machine, task, seed, source, recorded=True)
    drawing = _Drawing(subject, view, say)
    if report.machine_valid:
        return drawing.save(out)
    problem = report.problems[0].message
    if out.suffix.lower() not in ("", STILL):
        raise UsageError(f"{source} can only be drawn (.png), because it is not valid: {problem}")
    red = {block for pair in report.overlaps for block in pair}
    files = replace(drawing, red=red).save(out.with_suffix(STILL))
    notify(f"{source} is not valid: {problem}; overlapping blocks are red")
    return files


@dataclass(frozen=True)
class _Drawing:
    """What to draw or to film, and how."""

    subject: Subject
    view: str
    say: Progress
    """Receives the progress of the simulation."""
    red: Collection[int] = ()
    """Blocks to draw in red."""

    def save(self, out: Path) -> dict[str, str]:
        """Write the file, or without a suffix a picture and a film; kind -> path of each."""
        if not out.name:
            raise UsageError(f"--out takes a file name, not {str(out)!r}")
        files = [out] if out.suffix else [out.with_suffix(GIF), out.with_suffix(STILL)]
        for file in files:
            with write_output(file) as part:
                self._write(part)
        return {NAMES[file.suffix.lower()]: str(file) for file in reversed(files)}

    def _write(self, file: Path) -> None:
        kind, machine = file.suffix.lower(), self.subject.machine
        assert machine is not None
        if kind == STILL:
            render_png(machine, file, view=self.view, red=self.red)
        elif kind in SAMPLES:
            rollout = self._simulate(1.0 / SAMPLES[kind])
            if kind == GLB:
                file.write_bytes(rollout_glb(machine, rollout))
            else:
                save_film(machine, self.subject.task, rollout, file, size=SIZES[kind])
        else:
            raise UnknownNameError("kind of picture", kind, (STILL, *SAMPLES))

    def _simulate(self, interval: float) -> Rollout:
        choose_engine(self.subject.task.engine)  # raises here rather than in a worker
        rollout = simulate_in_parallel(
            self.subject, workers=WORKERS, say=self.say, interval=interval
        )
        if rollout.trace is None:
            why = "; ".join(str(problem["message"]) for problem in rollout.problems)
            raise UsageError(
                f"nothing to film: the rollout ended with status {rollout.status} ({why})"
            )
        return rollout
