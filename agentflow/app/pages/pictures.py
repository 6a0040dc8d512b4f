"""Pictures, films and 3D files of a run or a machine file."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from shlex import quote

from agentflow.app.machines.files import read_source
from agentflow.app.subjects.subject import WORKERS, Subject, simulate_in_parallel
from agentflow.env.drawing.backdrop import PAPER, SCREEN
from agentflow.env.drawing.film import save_film, save_strip
from agentflow.env.drawing.glb import rollout_glb
from agentflow.env.drawing.stills import SHEET, StillOptions, render_png
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
SAMPLES = {STILL: 20, GIF: 10, MP4: 20, GLB: 20}
"""Samples per second of what is simulated."""
NAMES = {STILL: "picture", GIF: "film", MP4: "film", GLB: "model"}
SIZES = {STILL: (800, 600), SHEET: (1500, 1000), GIF: (480, 360), MP4: (640, 480)}
GROUNDS = {"screen": SCREEN, "paper": PAPER}
SMALLEST, LARGEST = 16, 4096
"""Limits of the width and height of a picture, pixels."""
FASTEST = {GIF: 50, MP4: 60}
"""Most frames per second: players show a GIF's frames for at least 0.02 s."""
MOST_MOMENTS = 12


@dataclass(frozen=True)
class Wanted:
    """How a machine is drawn or filmed."""

    view: str = "three-quarter"
    size: tuple[int, int] | None = None
    """Width and height in pixels."""
    style: str = "screen"
    """Of `GROUNDS`."""
    fps: int | None = None
    """Frames per second of a film."""
    moments: int | None = None
    """A picture shows so many moments of the simulation side by side."""
    scene: bool = False
    axes: bool = False
    scale: bool = False
    transparent: bool = False

    def check(self, kind: str) -> None:
        """Raise UsageError if a file of this kind cannot be like this."""
        if self.style not in GROUNDS:
            raise UnknownNameError("style", self.style, tuple(GROUNDS))
        if self.size and not all(SMALLEST <= side <= LARGEST for side in self.size):
            raise UsageError(f"--size takes {SMALLEST} to {LARGEST} pixels for width and height")
        built = self.scene or self.axes or self.scale or self.transparent
        if built and (kind != STILL or self.moments):
            what = "--scene, --axes, --scale and --transparent"
            raise UsageError(f"{what} draw a machine as built: a .png file without --moments")
        if self.moments and not (kind == STILL and 2 <= self.moments <= MOST_MOMENTS):
            raise UsageError(f"--moments takes 2 to {MOST_MOMENTS}, for a .png file")
        if self.fps and not 1 <= self.fps <= FASTEST.get(kind, 0):
            raise UsageError("--fps takes 1 to 60 for an .mp4 file and 1 to 50 for a .gif file")


AS_EVER = Wanted()
ProgressOf = Callable[[str], Progress]  # noun, such as "frame" -> receives how many are done


def read_size(text: str | None) -> tuple[int, int] | None:
    """Width and height from "1920x1080"; UsageError if it says something else."""
    if text is None:
        return None
    found = re.fullmatch(r"(\d{1,5})x(\d{1,5})", text)
    if found is None:
        raise UsageError(f"--size takes width and height, such as 1920x1080, not {text[:40]!r}")
    return int(found[1]), int(found[2])


def render_run(
    path: Path,
    out: Path | None = None,
    wanted: Wanted = AS_EVER,
    tell: ProgressOf = lambda _: silent,
    engine: str | None = None,
) -> dict[str, str]:
    """Draw or film the best machine of a finished run: `out`, by default best.png and best.gif.

    Films show a simulation with `engine`, by default that of the run.
    """
    subject = Subject.of_run(path)
    if engine is not None:
        subject = subject.on(engine)
    return _Drawing(subject, wanted, tell).save(out or path / "best")


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

    def say(done: int, of: int) -> None:
        if listener is not None:
            listener(DrawingEvent(frames=(done, of)))

    try:
        if missing:
            say(0, 0)
        for file in missing:
            render_run(path, file, tell=lambda noun: say if noun == "frame" else silent)
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
    source: str, task: Task, seed: int, out: Path, wanted: Wanted, tell: ProgressOf, notify: Notify
) -> dict[str, str]:
    """Draw or film the machine of a file, depending on the suffix of `out`; both without one.

    An invalid machine is only drawn, with the blocks that overlap in red; `notify` gets the reason.
    """
    report = check(read_source(source, tuple(library())))
    if report.machine is None:
        raise UsageError(f"{source} cannot be built: {report.problems[0].message}")
    subject = Subject(report.machine, task, seed, source, recorded=True)
    drawing = _Drawing(subject, wanted, tell)
    if report.machine_valid:
        return drawing.save(out)
    problem = report.problems[0].message
    if out.suffix.lower() not in ("", STILL) or wanted.moments:
        raise UsageError(f"{source} can only be drawn (.png), because it is not valid: {problem}")
    red = {block for pair in report.overlaps for block in pair}
    files = replace(drawing, red=red).save(out.with_suffix(STILL))
    notify(f"{source} is not valid: {problem}; overlapping blocks are red")
    return files


@dataclass(frozen=True)
class _Drawing:
    """What to draw or to film, and how."""

    subject: Subject
    wanted: Wanted
    tell: ProgressOf
    red: Collection[int] = ()
    """Blocks to draw in red."""

    def save(self, out: Path) -> dict[str, str]:
        """Write the file, or without a suffix a picture and a film; kind -> path of each."""
        if not out.name:
            raise UsageError(f"--out takes a file name, not {str(out)!r}")
        files = [out] if out.suffix else [out.with_suffix(GIF), out.with_suffix(STILL)]
        if self.wanted != replace(AS_EVER, view=self.wanted.view):
            if not out.suffix:
                raise UsageError("name one file to draw, such as --out picture.png or film.mp4")
            self.wanted.check(out.suffix.lower())
        for file in files:
            with write_output(file) as part:
                self._write(part)
        return {NAMES[file.suffix.lower()]: str(file) for file in reversed(files)}

    def _write(self, file: Path) -> None:
        kind, machine, task = file.suffix.lower(), self.subject.machine, self.subject.task
        wanted, ground = self.wanted, GROUNDS[self.wanted.style]
        assert machine is not None
        if kind == STILL and wanted.moments is None:
            options = StillOptions(
                None if wanted.transparent else ground,
                wanted.axes,
                wanted.scale,
                task.scene(machine) if wanted.scene else None,
            )
            size = wanted.size or SIZES[SHEET if wanted.view == SHEET else STILL]
            render_png(machine, file, view=wanted.view, size=size, red=self.red, options=options)
        elif kind in SAMPLES:
            rollout = self._simulate(1.0 / (wanted.fps or SAMPLES[kind]))
            if kind == GLB:
                file.write_bytes(rollout_glb(machine, rollout))
                return
            if wanted.moments:
                drawn = partial(save_strip, size=wanted.size, count=wanted.moments)
            else:
                size = wanted.size or SIZES[kind]
                drawn = partial(save_film, size=size, say=self.tell("frame"))
            drawn(machine, task, rollout, file, ground=ground)
        else:
            raise UnknownNameError("kind of picture", kind, tuple(SAMPLES))

    def _simulate(self, interval: float) -> Rollout:
        choose_engine(self.subject.task.engine)  # raises here rather than in a worker
        rollout = simulate_in_parallel(
            self.subject, workers=WORKERS, say=self.tell("trial"), interval=interval
        )
        if rollout.trace is None:
            why = "; ".join(str(problem["message"]) for problem in rollout.problems)
            raise UsageError(
                f"nothing to film: the rollout ended with status {rollout.status} ({why})"
            )
        return rollout
