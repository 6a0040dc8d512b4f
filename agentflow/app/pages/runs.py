"""Owns reports of runs: what was recorded is read, simulated again, and put on a page."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from agentflow.app.design.models import cost_function
from agentflow.app.design.results import read_finished
from agentflow.app.inspect.failures import count_failures
from agentflow.app.inspect.reading import recorded_machine
from agentflow.app.pages.films import Shapes, exhibit
from agentflow.config.run import PROCEDURAL, DesignConfig, build
from agentflow.env.archive import load_npz
from agentflow.env.constants import constants
from agentflow.env.pool.pool import RolloutPool
from agentflow.env.rollout import Rollout
from agentflow.env.simulation.trials import SHOWN_TRIAL, joined
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.registry import get_level, get_task
from agentflow.errors import UsageError
from agentflow.files import write_atomically
from agentflow.machine import Machine, library, read_machine
from agentflow.report.page import check_bundle, page
from agentflow.report.run import RunStory
from agentflow.runs import read_document

FINE, COARSE = 1 / 30, 0.1
"""Seconds between the samples of a film: of the best machines, and of the others."""
BEST = 8
"""Machines with fine films."""
Say = Callable[[int, int], None]
"""Told after every rollout: how many are done, of how many."""


@dataclass(frozen=True)
class Shown:
    """A machine of a run that a page shows."""

    machine: Machine
    task: Task
    seed: int
    score: float | None
    """As recorded."""
    interval: float | None
    """Seconds between the samples of its film; None shows it as built."""
    kept: Path | None = None
    """The recorded rollout, where that is to be shown instead of one of today."""


def report(path: Path, out: Path, *, films: int, workers: int, say: Say) -> Path:
    """Write the page of a run, finished or not.

    Args:
        path: Run directory.
        out: The file.
        films: Machines with a film, the best ones first; the others are shown as built.
        workers: Processes that simulate them.
        say: Told of the progress.

    Raises:
        RunError: The run is damaged.
        UsageError: The file cannot be written, or the page's bundle is missing.
    """
    document = read_document(path)
    ready(out)
    config = build(document.get("config"))
    result = read_finished(path) if (path / "result.json").exists() else None
    story = RunStory.read(path, result, best_of(result))
    priced = bool(config.model.prices) or config.model.name == PROCEDURAL
    data = story.to_json(cost_function(config.model), priced)
    data["failures"] = count_failures(path)["kinds"]  # now: a run under way goes on meanwhile
    shapes = Shapes()
    machines = asyncio.run(exhibits(_chosen(path, story, config, films), shapes, workers, say))
    data |= {"machines": machines, "shapes": shapes.rows, "task": asked(config)}
    write(out, page(f"{config.task} · agentflow", data))
    return out


def asked(config: DesignConfig) -> dict[str, Any]:
    """What the machines were to do, as their designers were told."""
    brief = get_task(config.task, config.knobs).brief
    return {
        "title": get_level(config.task).file.title,
        "objective": brief.objective,
        "score": list(brief.score),
        "scene": [*brief.scene, *brief.schedule],
    }


def ready(out: Path) -> None:
    """See that a page can be made and written, before work is done for it.

    Raises:
        UsageError: The bundle is missing, or the file cannot be written.
    """
    check_bundle()
    if out.is_dir() or not out.parent.is_dir():
        why = "it is a folder" if out.is_dir() else f"there is no folder {out.parent}"
        raise UsageError(f"cannot write {out}: {why}")


def best_of(result: Mapping[str, Any] | None) -> str | None:
    """Content hash of the machine that a run gave; None when it gave none."""
    if result is None or not result["valid"]:
        return None
    machine = read_machine(result["machine"], library()).machine
    return machine.digest if machine is not None else None


async def exhibits(
    chosen: Mapping[str, Shown], shapes: Shapes, workers: int, say: Say
) -> dict[str, dict[str, Any]]:
    """The machines as a page shows them, each simulated as its run did; by the same keys."""
    done = 0
    filmed = [key for key, item in chosen.items() if item.interval is not None]

    async def shown(key: str, item: Shown) -> tuple[str, dict[str, Any]]:
        nonlocal done
        played = await _played(item, pool)
        rollout = _kept(item) if item.kept is not None else joined(played) if played else None
        if key in filmed:
            done += 1
            say(done, len(filmed))
        trials = played if item.interval == FINE else ()
        given, remark = item.task.brief.given, _remark(item, rollout)
        return key, exhibit(item.machine, rollout, shapes, remark, given=given, played=trials)

    async with RolloutPool(max(1, min(workers, len(filmed)))) as pool:
        found = dict(await asyncio.gather(*(shown(key, item) for key, item in chosen.items())))
    return {key: found[key] for key in chosen}


def write(out: Path, text: str) -> None:
    """Write a page.

    Raises:
        UsageError: The file cannot be written.
    """
    try:
        with write_atomically(out) as part:
            part.write_text(text, encoding="utf-8")
    except OSError as error:
        raise UsageError(f"cannot write {out}: {error.strerror}") from None


def _chosen(path: Path, story: RunStory, config: DesignConfig, films: int) -> dict[str, Shown]:
    """Every machine of the tree, the best ones first."""
    task = get_task(config.task, config.knobs)
    found = {}
    for place, (digest, node) in enumerate(story.machines.items()):
        interval = None if place >= films else FINE if place < BEST else COARSE
        found[digest] = Shown(
            machine=recorded_machine(path, digest),
            task=task,
            seed=config.seed,
            score=node.score,
            interval=interval,
            kept=kept_rollout(path, story.document, digest),
        )
    return found


def kept_rollout(path: Path, document: Mapping[str, Any], digest: str) -> Path | None:
    """The recorded rollout of a machine, if there is one and physics has changed since."""
    file = path / "rollouts" / f"{digest}.npz"
    changed = document.get("constants") != constants().digest
    return file if changed and file.exists() else None


async def _played(item: Shown, pool: RolloutPool) -> Sequence[Rollout]:
    """Its trials, simulated again; none where none is to be."""
    if item.kept is not None or item.interval is None:
        return ()
    trials = item.task.trials(item.seed)
    runs = (
        pool.run(item.machine, trial, seed=item.seed, interval=item.interval) for trial in trials
    )
    return await asyncio.gather(*runs)


def _kept(item: Shown) -> Rollout | None:
    """The recorded rollout, with what stood around the machine in the trial that it shows.

    None where its file cannot be read.
    """
    assert item.kept is not None
    try:
        rollout = load_npz(item.kept)
    except UsageError:
        return None
    number = rollout.terms.get(SHOWN_TRIAL)
    trials = item.task.trials(item.seed)
    shown = item.task if number is None else trials[int(number) - 1]
    return replace(rollout, scene=shown.scene(item.machine))


def _remark(item: Shown, rollout: Rollout | None) -> str:
    if rollout is None and item.kept is not None:
        return "Shown as built: its recorded rollout cannot be read."
    if rollout is None:
        return "Shown as built: this page has films of better machines only."
    if item.kept is not None:
        return "As recorded: the physical constants have changed since."
    if rollout.trace is None:
        return f"Shown as built: its simulation ended as {rollout.status}."
    told = []
    if SHOWN_TRIAL in rollout.terms and item.interval != FINE:
        told.append(_trial(rollout))
    if rollout.score != item.score and item.score is not None:
        told.append(
            f"Simulated again with today's physics: {rollout.score:.2f}, "
            f"recorded were {item.score:.2f}."
        )
    return " ".join(told)


def _trial(rollout: Rollout) -> str:
    """Which trial a film of many shows."""
    number, count = int(rollout.terms[SHOWN_TRIAL] or 1), int(rollout.terms["trials"] or 1)
    return f"Trial {number} of {count}: {rollout.terms[f'outcome_{number}']}."
