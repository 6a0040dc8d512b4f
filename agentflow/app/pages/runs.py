"""Pages of runs: the record, and films of the machines, simulated again."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from agentflow.app.design.conditions import describe_changes
from agentflow.app.design.execution import best_machine
from agentflow.app.design.plan import level_note, level_of_run, task_of_run
from agentflow.app.inspect.failures import count_failures
from agentflow.app.inspect.overview import later_note
from agentflow.app.machines.convert import MADE, made_file
from agentflow.app.pages.films import Shapes, machine_data
from agentflow.app.pages.robustness import kept_figure
from agentflow.config.run import build_config
from agentflow.env.archive import load_npz
from agentflow.env.drawing.stills import png_url
from agentflow.env.physics.engines import physics_conditions, usable_engine
from agentflow.env.pool.pool import RolloutPool
from agentflow.env.rollout import Rollout
from agentflow.env.simulation.trials import SHOWN_TRIAL, combine_trials
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.records import record_json
from agentflow.errors import RunError, UsageError
from agentflow.extras import is_installed
from agentflow.machine import Brief, Machine
from agentflow.machine.edits.difference import edit_text, edit_words
from agentflow.metrics.machines import recorded_machine
from agentflow.models.choices import cost_function
from agentflow.progress import Progress, counter
from agentflow.report.page import require_writable, write_page
from agentflow.report.run import RunStory
from agentflow.runs import read_document, read_result
from agentflow.runs.reading import RESULT

FINE, COARSE = 1 / 30, 0.1
"""Seconds between samples of films: of the best machines, and of the others."""
BEST = 8
"""Number of machines with fine films."""
THUMBNAIL = (320, 240)
"""Width and height of pictures on cards, in pixels."""


@dataclass(frozen=True)
class ReportedMachine:
    """A machine on a page."""

    machine: Machine
    task: Task
    seed: int
    score: float | None
    """The recorded score."""
    interval: float | None
    """Seconds between samples of its film; None shows it as built."""
    recorded: Path | None = None
    """Its recorded rollout, shown instead of a new one if physics has changed since."""
    changes: str = ""
    """What has changed; see `describe_changes`."""

    @classmethod
    def of(
        cls,
        path: Path,
        document: Mapping[str, Any],
        machine: Machine,
        score: float | None,
        interval: float | None,
    ) -> ReportedMachine:
        """A machine of the run at `path`, whose run.yaml holds `document`.

        If the engine of the run is not installed, the default one takes its place.
        """
        config = build_config(document.get("config"))
        task = task_of_run(path, document)
        task = replace(task, engine=usable_engine(task.engine))
        file = path / "rollouts" / f"{machine.digest}.npz"
        changes = describe_changes(document, physics_conditions(task.engine))
        recorded = file if changes and file.exists() else None
        return cls(machine, task, config.seed, score, interval, recorded, changes)

    @property
    def trials(self) -> tuple[Task, ...]:
        """The trials to simulate; none if the machine is shown as built or as recorded."""
        if self.recorded is not None or self.interval is None:
            return ()
        return self.task.trials(self.seed)


def report(path: Path, out: Path, *, films: int, workers: int, say: Progress) -> Path:
    """Write the page of a run, finished or not.

    Args:
        path: Run directory.
        out: File to write.
        films: Number of machines with a film, best first; the others are shown as built.
        workers: Worker processes for simulation.
        say: Receives progress.
    """
    read_document(path)  # a folder that is not a run is named before the place of its page
    require_writable(out)
    write_page(out, *asyncio.run(run_page(path, films=films, workers=workers, say=say)))
    return out


async def run_page(
    path: Path, *, films: int, workers: int, say: Progress
) -> tuple[str, dict[str, Any]]:
    """The title and the data of the page of a run; arguments as for `report`."""
    story, data = run_data(path)
    shapes = Shapes()
    chosen = _machines_to_report(path, story, films)
    machines = await film_machines(chosen, shapes, workers, say)
    for digest in list(chosen)[:1]:  # the best one
        machines[digest]["files"] |= _files_to_make(chosen[digest].machine, shapes)
    classes = story.classes({digest: item["mechanism"] for digest, item in machines.items()})
    data |= {
        "machines": machines,
        "classes": [item | {"picture": thumbnail(chosen[item["machine"]])} for item in classes],
        **shapes.data,
    }
    return f"{data['run']['task']} · agentflow", data


def _files_to_make(machine: Machine, shapes: Shapes) -> dict[str, tuple[int, int]]:
    """Name -> place of instructions and CAD files, as far as the machine and what is installed
    allow: one that cannot be built in any order has no instructions."""
    found = {}
    for suffix, library in MADE.items():
        if not library or is_installed(library):
            with suppress(UsageError):
                name = f"machine-{machine.digest}{suffix}"
                found[name] = shapes.attach(made_file(machine, suffix))
    return found


def run_data(path: Path) -> tuple[RunStory, dict[str, Any]]:
    """The record of a run, and the data of its page without machines and films."""
    document = read_document(path)
    config = build_config(document.get("config"))
    result = read_result(path) if (path / RESULT).exists() else None
    best = best_machine(result)
    story = RunStory.read(path, result, best.digest if best else None)
    priced = bool(config.model.prices) or config.model.local
    data = story.to_json(cost_function(config.model), priced)
    data["failures"] = count_failures(path)["kinds"]  # last: the run may be in progress
    data |= {"task": task_summary(path, document), "robustness": kept_figure(path, best)}
    score = result.trusted_score if result else data["run"]["score"]
    data["task"] |= {"record": record_json(task_of_run(path, document), score)}
    _tell_edits(path, data["nodes"])
    if result and result.met:
        data["run"]["about"] += "; met {} of {} requirements".format(*result.met)
    if note := level_note(path, document):
        data["facts"].append(["Level", note])
    return story, data


def _tell_edits(path: Path, nodes: Sequence[dict[str, Any]]) -> None:
    """Add to each node the edit that made its machine, in words, as `told`.

    Edits that no model wrote, such as random ones, are found from both machines.
    """
    known = {node["id"]: node["machine"] for node in nodes}
    for node in nodes:
        before, after, edited = known.get(node["parent"]), node["machine"], None
        with suppress(RunError):  # damaged files are named where their film would be
            edited = recorded_machine(path, before) if before else None
            if edited and after and not node["edit"]:
                node["edit"] = edit_text(edited, recorded_machine(path, after))
        node["told"] = edit_words(node["edit"], edited)


def task_summary(path: Path, document: Mapping[str, Any]) -> dict[str, Any]:
    """Title, objective, score and scene of the task of a run, as worded in prompts."""
    task, file = task_of_run(path, document), level_of_run(path, document).file
    told = {"title": file.title, "unit": task.unit, "greatest": task.brief.greatest}
    changed = build_config(document.get("config")).knobs  # `good` is for the level as it is
    good = None if changed else file.good
    return {**told, "good": good, **task_wording(task.brief)}


def task_wording(brief: Brief) -> dict[str, Any]:
    """Objective, score and scene of a task, as worded in prompts."""
    scene = [*brief.scene, *brief.schedule]
    return {"objective": brief.objective, "score": list(brief.score), "scene": scene}


def thumbnail(item: ReportedMachine) -> str:
    """A small picture of a machine as built, as a data URL."""
    return png_url(item.machine, view="three-quarter", size=THUMBNAIL)


async def film_machines(
    chosen: Mapping[str, ReportedMachine], shapes: Shapes, workers: int, say: Progress
) -> dict[str, dict[str, Any]]:
    """Simulate machines as in their runs; the data of each for a page, by the same keys."""
    total = sum(len(item.trials) for item in chosen.values())
    tick = counter(say, total)

    async def film(key: str, item: ReportedMachine) -> tuple[str, dict[str, Any]]:
        return key, await film_machine(item, shapes, pool, tick)

    pool = RolloutPool(max(1, min(workers, total)))
    async with pool if total else nullcontext():
        found = dict(await asyncio.gather(*(film(key, item) for key, item in chosen.items())))
    return {key: found[key] for key in chosen}


async def film_machine(
    item: ReportedMachine,
    shapes: Shapes,
    pool: RolloutPool,
    count: Callable[[], None] = lambda: None,
) -> dict[str, Any]:
    """Simulate a machine as in its run; its data for a page. `count` is called after each trial."""
    played = await simulate_trials(item, pool, count)
    if item.recorded is not None:
        rollout = _load_recorded(item, item.recorded)
    else:
        rollout = combine_trials(played, item.trials) if played else None
    trials = played if item.interval == FINE else ()
    brief = item.task.brief
    remark, note = _remark(item, rollout), later_note(item.machine, brief)
    remark = " ".join(filter(None, (remark, note and f"The machine {note}.")))
    return machine_data(item.machine, rollout, shapes, remark, given=brief.given, played=trials)


def _machines_to_report(path: Path, story: RunStory, films: int) -> dict[str, ReportedMachine]:
    """Every machine of the search tree, best first."""
    found = {}
    for rank, (digest, node) in enumerate(story.machines.items()):
        filmed = rank < films and node.status  # a tool may make machines that nobody simulates
        interval = (FINE if rank < BEST else COARSE) if filmed else None
        machine = recorded_machine(path, digest)
        found[digest] = ReportedMachine.of(path, story.document, machine, node.score, interval)
    return found


async def simulate_trials(
    item: ReportedMachine, pool: RolloutPool, count: Callable[[], None] = lambda: None
) -> Sequence[Rollout]:
    """Simulate the trials of a machine again; `count` is called after each."""

    async def play(trial: Task) -> Rollout:
        rollout = await pool.run(
            item.machine, trial, seed=item.seed, interval=item.interval, recorded=True
        )
        count()
        return rollout

    return await asyncio.gather(*map(play, item.trials))


def _load_recorded(item: ReportedMachine, file: Path) -> Rollout | None:
    """The recorded rollout with the scene of the trial that it shows; None if unreadable."""
    try:
        rollout = load_npz(file)
    except UsageError:
        return None
    number = rollout.terms.get(SHOWN_TRIAL)
    trials = item.task.trials(item.seed)
    shown = item.task if number is None else trials[int(number) - 1]
    return replace(rollout, scene=shown.scene(item.machine))


def _remark(item: ReportedMachine, rollout: Rollout | None) -> str:
    if rollout is None and item.recorded is not None:
        return "Shown as built: its recorded rollout cannot be read."
    if rollout is None:
        return "Shown as built: this page only has films of better machines."
    if item.recorded is not None:
        return f"As recorded, with different {item.changes}."
    if rollout.trace is None:
        return f"Shown as built: its simulation ended as {rollout.status}."
    notes = []
    if SHOWN_TRIAL in rollout.terms and item.interval != FINE:
        notes.append(_describe_trial(rollout))
    if rollout.score != item.score and item.score is not None:
        how = f"different {item.changes}" if item.changes else "current physics"
        notes.append(
            f"Simulated again with {how}: {rollout.score:.2f}; "
            f"the recorded score is {item.score:.2f}."
        )
    return " ".join(notes)


def _describe_trial(rollout: Rollout) -> str:
    """Which of several trials a film shows."""
    number, count = int(rollout.terms[SHOWN_TRIAL] or 1), int(rollout.terms["trials"] or 1)
    return f"Trial {number} of {count}: {rollout.terms[f'outcome_{number}']}."
