"""Compares two machines: blocks, scores, and a page with both films."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from agentflow.app.design.plan import task_of_run
from agentflow.app.machines.files import read_one
from agentflow.app.pages.films import Shapes, machine_data
from agentflow.app.pages.runs import FINE, ReportedMachine, simulate_trials, task_wording
from agentflow.config.run import build_config
from agentflow.env.physics.engine import AUTO
from agentflow.env.physics.engines import choose_engine, usable_engine
from agentflow.env.pool.pool import RolloutPool
from agentflow.env.rollout import Rollout
from agentflow.env.simulation.trials import combine_trials
from agentflow.env.tasks.base import Task
from agentflow.errors import UsageError
from agentflow.machine import Geometry, Machine, library, place
from agentflow.machine.controls import control_text
from agentflow.machine.geometry.pose import Placed
from agentflow.metrics.machines import recorded_machine
from agentflow.progress import Progress, counter
from agentflow.report.page import require_writable, write_page
from agentflow.runs import read_document, read_result
from agentflow.runs.events import read_typed_events
from agentflow.runs.reading import RESULT
from agentflow.runs.record import RunRecord

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
        sources: Machine files, or run directories for their best machines; of an unfinished run,
            the best one so far.
        task: Task to simulate both on; by default that of the runs. Without a task, there are no
            scores.
        seed: Random seed; by default that of the first run, else 0.
        engine: Physics engine that simulates both; by default that of `task`, or that of the
            runs if they have the same and it is installed.
        out: HTML file to write.
        workers: Worker processes for simulation.
        say: Receives progress.

    Raises:
        UsageError: A machine cannot be read, a run has no score yet, the runs are of different
            tasks, or a page is wanted without a task, or the engine is not installed.

    Returns:
        `task`, `seed`, `engine` (name and version; None without a task), `notes` (runs that are
        unfinished or have another engine), `machines`, `same`, `only` and `types`.
    """
    if out is not None:
        require_writable(out)
    comparison = Comparison.of(sources, task, seed, engine)
    if out is not None and comparison.level is None:
        raise UsageError("the films need a task; name it with --task")
    played = asyncio.run(_play_alone(comparison, workers, say)) if comparison.level else [(), ()]
    if out is not None:
        data = comparison.page_data(played)
        write_page(out, "Comparison · agentflow", data)
    return comparison.found(played)


@dataclass(frozen=True)
class Comparison:
    """Two machines, and what both are simulated on."""

    sources: tuple[str, str]
    machines: tuple[Machine, Machine]
    level: Task | None
    seed: int
    engine: str | None
    """Name and version; None without a task."""
    notes: tuple[str, ...]

    @classmethod
    def of(
        cls,
        sources: tuple[str, str],
        task: Task | None = None,
        seed: int | None = None,
        engine: str | None = None,
    ) -> Comparison:
        """Read both machines, and choose what they are simulated on; see `compare`."""
        machines = (_machine_of(sources[0]), _machine_of(sources[1]))
        runs = {path: read_document(path) for path in map(Path, sources) if path.is_dir()}
        level = task or _common_task([task_of_run(*run) for run in runs.items()])
        used = None
        if level is not None:
            chosen = choose_engine(engine or usable_engine(level.engine))
            level, used = replace(level, engine=chosen.name), str(chosen.identity)
        seeds = [build_config(document.get("config")).seed for document in runs.values()]
        number = seed if seed is not None else next(iter(seeds), 0)
        notes = tuple(
            f"{path} is unfinished: this is its best machine so far"
            for path in runs
            if not (path / RESULT).exists()
        ) + tuple(
            f"{path} was made with {made}, but both are simulated with {used} here"
            for path, document in runs.items()
            if used and (made := document.get("engine", used)) != used
        )
        return cls(sources, machines, level, number, used, notes)

    async def play(
        self, pool: RolloutPool, count: Callable[[], None] = lambda: None
    ) -> list[Played]:
        """Simulate both; `count` is called after each trial."""
        return list(
            await asyncio.gather(*(simulate_trials(item, pool, count) for item in self.items))
        )

    @property
    def items(self) -> list[ReportedMachine]:
        """Both machines as on a page; none without a task."""
        if self.level is None:
            return []
        level, seed = self.level, self.seed
        return [ReportedMachine(m, level, seed, None, FINE) for m in self.machines]

    def _whole(self, played: Played) -> Rollout | None:
        """The rollout of a machine; None if nothing was simulated."""
        if self.level is None or not played:
            return None
        return combine_trials(played, self.level.trials(self.seed))

    def found(self, played: Sequence[Played]) -> dict[str, Any]:
        """What `compare` returns."""
        rollouts = [self._whole(trials) for trials in played]
        return {
            "task": self.level.name if self.level else None,
            "seed": self.seed,
            "engine": self.engine,
            "notes": list(self.notes),
            "machines": [
                _facts(source, machine, rollout)
                for source, machine, rollout in zip(
                    self.sources, self.machines, rollouts, strict=True
                )
            ],
            **_difference(*map(place, self.machines)),
            **_program_difference(*self.machines),
        }

    def page_data(self, played: Sequence[Played]) -> dict[str, Any]:
        """The data of the page, with both films."""
        assert self.level is not None
        brief, shapes = self.level.brief, Shapes()
        films = [
            machine_data(machine, self._whole(trials), shapes, given=brief.given, played=trials)
            for machine, trials in zip(self.machines, played, strict=True)
        ]
        return {
            "kind": "compare",
            **self.found(played),
            "films": films,
            "runs": [_run_facts(Path(source)) for source in self.sources],
            **shapes.data,
            "asked": {**task_wording(brief), "unit": self.level.unit},
        }


def _machine_of(source: str) -> Machine:
    """The machine of a file or a run; of an unfinished run, the best one so far."""
    path = Path(source)
    if not path.is_dir() or (path / RESULT).exists():
        return read_one(source)
    read_document(path)  # refuses edited runs and links
    made = RunRecord.of(read_typed_events(path)).machines.values()
    scores = {each.machine: each.score for each in made if each.valid and each.score is not None}
    if not scores:
        raise UsageError(f"{path} is unfinished, and no machine of it has a score yet")
    return recorded_machine(path, max(scores, key=lambda machine: scores[machine]))


def _program_difference(one: Machine, other: Machine) -> dict[str, Any]:
    """As `controls`, the entries that only one of two machines has; nothing if neither has any."""
    if not (one.controls or other.controls):
        return {}
    programs = (one.controls, other.controls), (other.controls, one.controls)
    only = [[control_text(each) for each in own if each not in rest] for own, rest in programs]
    return {"controls": only}


async def _play_alone(comparison: Comparison, workers: int, say: Progress) -> list[Played]:
    trials = sum(len(item.trials) for item in comparison.items)
    async with RolloutPool(workers) as pool:
        return await comparison.play(pool, counter(say, trials))


def _common_task(tasks: Sequence[Task]) -> Task | None:
    """The task of all runs, for their engine if it is the same for all; None without runs."""
    engines = {task.engine for task in tasks}
    shared = engines.pop() if len(engines) == 1 else AUTO
    tasks = [replace(task, engine=shared) for task in tasks]
    if any(task != tasks[0] for task in tasks):
        names = " and ".join(task.name for task in tasks)
        raise UsageError(f"the runs are of different tasks ({names}); name one with --task")
    return tasks[0] if tasks else None


def _run_facts(path: Path) -> dict[str, Any] | None:
    """What a run asked for, spent and reached; None for a machine file."""
    if not path.is_dir():
        return None
    config = build_config(read_document(path).get("config"))
    record = RunRecord.of(read_typed_events(path))
    found = record.verification
    return {
        "workflow": config.workflow,
        "model": record.start and record.start.model,
        "calls": record.calls,
        "simulations": record.evaluations,
        "seed": config.seed,
        "score": read_result(path).score if (path / RESULT).exists() else record.best,
        "verified": found and found.score,
        "fragile": bool(found and found.holding and found.holding.fragile),
    }


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
