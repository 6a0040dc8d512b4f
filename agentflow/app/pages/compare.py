"""Compares two machines: blocks, scores, and a page with both films."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from agentflow.app.design.plan import task_of_run
from agentflow.app.machines.files import read_one
from agentflow.app.machines.simulate import Progress
from agentflow.app.pages.films import Shapes, machine_data
from agentflow.app.pages.runs import (
    FINE,
    ReportedMachine,
    simulate_trials,
)
from agentflow.config.run import build_config
from agentflow.env.physics.engines import AUTO, choose_engine, usable_engine
from agentflow.env.pool.pool import RolloutPool
from agentflow.env.rollout import Rollout
from agentflow.env.simulation.trials import combine_trials
from agentflow.env.tasks.base import Task
from agentflow.errors import UsageError
from agentflow.machine import Brief, Geometry, Machine, library, place
from agentflow.machine.geometry.pose import Placed
from agentflow.report.page import require_writable, write_page
from agentflow.runs import read_document

Played = Sequence[Rollout]
"""The trials of one machine, in order."""


def compare(
    sources: tuple[str, str],
    task: Task | None,
    seed: int | None,
    engine: str | None = None,
    *,
    out: Path | None = None,
    workers: int,
    say: Progress,
) -> dict[str, Any]:
    """Compare two machines, as data; with `out`, also as a page.

    Args:
        sources: Machine files, or run directories for their best machines.
        task: Task to simulate both on; by default that of the runs. Without a task, there are no
            scores.
        seed: Random seed; by default that of the first run, else 0.
        engine: Physics engine that simulates both; by default that of `task`, or that of the
            runs if they have the same and it is installed.
        out: HTML file to write.
        workers: Worker processes for simulation.
        say: Receives progress.

    Raises:
        UsageError: A machine cannot be read, the runs are of different tasks, or a page is wanted
            without a task, or the engine is not installed.

    Returns:
        `task`, `seed`, `engine` (name and version; None without a task), `notes` (runs that have
        another engine), `machines`, `same`, `only` and `types`.
    """
    machines = [read_one(source) for source in sources]
    runs = {path: read_document(path) for path in map(Path, sources) if path.is_dir()}
    level = task or _common_task([task_of_run(*run) for run in runs.items()])
    used = None
    if level is not None:
        chosen = choose_engine(engine or usable_engine(level.engine))
        level, used = replace(level, engine=chosen.name), str(chosen.identity)
    if out is not None:
        require_writable(out)
        if level is None:
            raise UsageError("the films need a task; name it with --task")
    seeds = [build_config(document.get("config")).seed for document in runs.values()]
    number = seed if seed is not None else next(iter(seeds), 0)
    played: list[Played] = [(), ()]
    if level is not None:
        items = [ReportedMachine(m, level, number, None, FINE, None, "") for m in machines]
        played = asyncio.run(_play(items, workers, say))
    rollouts = [combine_trials(trials) if trials else None for trials in played]
    found = {
        "task": level.name if level else None,
        "seed": number,
        "engine": used,
        "notes": [
            f"{path} was made with {made}, but both are simulated with {used} here"
            for path, document in runs.items()
            if used and (made := document.get("engine", used)) != used
        ],
        "machines": [
            _facts(source, machine, rollout)
            for source, machine, rollout in zip(sources, machines, rollouts, strict=True)
        ],
        **_difference(*map(place, machines)),
    }
    if out is not None and level is not None:
        shapes = Shapes()
        films = [
            machine_data(machine, rollout, shapes, given=level.brief.given, played=trials)
            for machine, rollout, trials in zip(machines, rollouts, played, strict=True)
        ]
        data = {
            "kind": "compare",
            **found,
            "task": f"{level.name} · {used}",
            "films": films,
            "shapes": shapes.rows,
            "files": shapes.files,
        }
        write_page(out, "Comparison · agentflow", {**data, "asked": _asked(level.brief)})
    return found


def _asked(brief: Brief) -> dict[str, Any]:
    """Objective, score and scene of a task, as worded in prompts."""
    scene = [*brief.scene, *brief.schedule]
    return {"objective": brief.objective, "score": list(brief.score), "scene": scene}


async def _play(items: Sequence[ReportedMachine], workers: int, say: Progress) -> list[Played]:
    total = sum(len(item.trials) for item in items)
    done = iter(range(1, total + 1))

    def count() -> None:
        say(next(done), total)

    async with RolloutPool(workers) as pool:
        return list(await asyncio.gather(*(simulate_trials(item, pool, count) for item in items)))


def _common_task(tasks: Sequence[Task]) -> Task | None:
    """The task of all runs, for their engine if it is the same for all; None without runs."""
    engines = {task.engine for task in tasks}
    shared = engines.pop() if len(engines) == 1 else AUTO
    tasks = [replace(task, engine=shared) for task in tasks]
    if any(task != tasks[0] for task in tasks):
        names = " and ".join(task.name for task in tasks)
        raise UsageError(f"the runs are of different tasks ({names}); name one with --task")
    return tasks[0] if tasks else None


def _facts(source: str, machine: Machine, rollout: Rollout | None) -> dict[str, Any]:
    return {
        "source": source,
        "blocks": len(machine),
        "mass": sum(library()[step.type].mass for step in machine),
        "size": list(place(machine).size),
        "status": rollout.status if rollout else None,
        "score": rollout.score if rollout else None,
        "terms": dict(rollout.terms) if rollout else {},
        "problems": [problem["message"] for problem in rollout.problems] if rollout else [],
    }


def _difference(a: Geometry, b: Geometry) -> dict[str, Any]:
    """Blocks that are in both machines, and those that are only in one.

    Two blocks are the same if type, position and direction are, relative to the root block; their
    ids may differ.
    """
    counts = [Counter(block.type for block in geometry.blocks) for geometry in (a, b)]
    only = [list(_only_in(a, b)), list(_only_in(b, a))]
    return {
        "same": len(a.blocks) - len(only[0]),
        "only": only,
        "types": [
            {"type": kind, "name": library()[kind].name, "counts": [c[kind] for c in counts]}
            for kind in sorted(counts[0] | counts[1])
            if counts[0][kind] != counts[1][kind]
        ],
    }


def _only_in(a: Geometry, b: Geometry) -> Iterator[dict[str, Any]]:
    others = Counter(map(_pose, b.blocks))
    for block in a.blocks:
        others[_pose(block)] -= 1
        if others[_pose(block)] < 0:
            ends = [block.origin] if block.end_b is None else [block.origin, block.end_b]
            yield {
                "id": block.id,
                "type": block.type,
                "name": block.name,
                "positions": [list(end) for end in ends],
                "direction": None if block.two_ended else block.facing,
            }


def _pose(block: Placed) -> tuple[object, ...]:
    ends = (block.at,) if block.far is None else tuple(sorted((block.at, block.far)))
    return block.type, ends, block.facing
