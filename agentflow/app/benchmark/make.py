"""New benchmarks: items drawn from a seed, each with what it takes to score nothing and all of it.

An item's share begins at its *floor*, what random machines and edits reach, and is 1 at its *par*,
what the built-in designer and its search reach with many simulations, or a machine that is known.
Where they reach hardly more than the designer's first machines, or little at all, the par is the
greatest possible score. An item is drawn again while first machines come near that as well, or
there is none; gears are drawn again as well, since they turn their targets or do not.
"""

from __future__ import annotations

import asyncio
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from itertools import count, cycle, islice
from pathlib import Path
from random import Random
from typing import Any
from uuid import UUID

import yaml

from agentflow.app.benchmark.plan import ITEM, PART, VERSION
from agentflow.app.design.execution import best_machine
from agentflow.app.design.run import design, resume
from agentflow.config.run import PROCEDURAL, build_config, load_document, set_key
from agentflow.config.sweep import Par
from agentflow.env.pool.pool import RolloutPool
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.registry import get_task
from agentflow.env.verification import verify_async
from agentflow.errors import ConfigError, RunError, UsageError
from agentflow.files.atomic import os_errors, write_output
from agentflow.files.ranges import draw_numbers
from agentflow.machine import Machine, library, read_machine
from agentflow.machine.validity import check
from agentflow.runs import Notify, RunResult
from agentflow.workflows.registry import WORKFLOWS

ITEMS = Path(__file__).with_name("items.yaml")
SET, MAKING, MACHINES = "set.yaml", "making", "machines"
TRIVIAL = 0.8
"""Greatest share of the par that first machines may reach."""
LUCK = 0.2
"""Least par, as a share of the greatest possible score: one of ten trials is won by chance."""
FEWEST = 20
"""Fewest simulations that set a par."""
DRAWS = 4
"""Most draws of an item; if none fits, the one whose first machines reach least counts."""
VERIFIED = 3
"""Known machines of an item that are verified: those with the best plain scores."""


@dataclass(frozen=True)
class NewSet:
    """A new benchmark."""

    file: Path
    """What to run: `agentflow benchmark FILE`."""
    machines: Path
    """Folder of the machines that reach the pars: solutions, to be kept apart."""
    pars: Mapping[str, Par]
    near: tuple[str, ...]
    """Items whose par the designer's first machines come near, whatever was drawn."""
    unsolved: tuple[str, ...]
    """Items whose par is the greatest possible score, as little or nothing was found."""

    def to_json(self) -> dict[str, Any]:
        """As JSON data."""
        pars = {name: par.model_dump() for name, par in self.pars.items()}
        places = {"file": str(self.file), "machines": str(self.machines)}
        return {**places, "pars": pars, "near": list(self.near), "unsolved": list(self.unsolved)}


@dataclass(frozen=True)
class _Drawn:
    changes: Mapping[str, Any]
    par: Par
    reached: float
    """Share of the par that first machines reach."""
    machine: str | None
    """One that reaches the par; None if none does."""


def make_benchmark(
    folder: Path,
    *,
    seed: int = 0,
    items: int = 33,
    simulations: int = 2000,
    workers: int = 2,
    known: Path | None = None,
    say: Notify,
) -> NewSet:
    """Draw the items of a new benchmark and measure their floors and pars.

    The folder keeps the runs; the same call continues what was stopped.

    Args:
        folder: Where to write.
        seed: Everything is drawn from it.
        items: How many; they go round the families.
        simulations: Of the search that sets a par; those of several trials count as many.
        workers: Worker processes.
        known: Folder of machines that may set pars as well, such as those of records.
        say: Receives a line for each item.

    Raises:
        UsageError: The folder holds another benchmark, or cannot be written; there is no machine in
            the folder of known ones.
        RunError: A verification failed, so that there is no floor or par.
        InterruptedRunError: Ctrl-C.
    """
    machines = _read_machines(known) if known else ()
    with os_errors(f"cannot write {folder}"):
        (folder / MAKING).mkdir(parents=True, exist_ok=True)
        (folder / MACHINES).mkdir(exist_ok=True)
    plan = {"seed": seed, "items": items, "simulations": simulations}
    _require_same(folder, {**plan, "machines": str(known.resolve()) if known else ""})
    drawn: dict[str, _Drawn] = {}
    for name, template in islice(_templates(), items):
        drawn[name] = _draw(folder, name, template, seed, simulations, workers, machines)
        par = drawn[name].par
        say(f"{name}: floor {par.floor:g}, par {par.par:g}; {len(drawn)} of {items} items")
        if (machine := drawn[name].machine) is not None:
            with write_output(folder / MACHINES / f"{name}.json") as part:
                part.write_text(machine, encoding="utf-8")
    pars = {name: item.par for name, item in drawn.items()}
    document = {
        "title": f"Benchmark of seed {seed}",
        "about": "Single replies without feedback, and the best machines of runs with it.",
        "benchmark": {
            "version": VERSION,
            "canary": f"agentflow-benchmark {UUID(int=Random(f'{seed}/canary').getrandbits(128))}",
            "pars": {name: par.model_dump() for name, par in pars.items()},
        },
        "base": {"engine": content()["engine"]},
        "seeds": [0],
        "axes": {
            PART: content()["parts"],
            ITEM: {name: dict(item.changes) for name, item in drawn.items()},
        },
        "table": {"metrics": ["share"]},
    }
    with write_output(folder / SET) as part:
        part.write_text(yaml.safe_dump(document, sort_keys=False, width=100), encoding="utf-8")
    near = tuple(name for name, item in drawn.items() if item.reached > TRIVIAL)
    unsolved = tuple(name for name, item in drawn.items() if item.machine is None)
    return NewSet(folder / SET, folder / MACHINES, pars, near, unsolved)


def _require_same(folder: Path, plan: Mapping[str, Any]) -> None:
    """Note what the folder is for, or raise UsageError if it is for something else."""
    file = folder / MAKING / "plan.yaml"
    if not file.exists():
        with write_output(file) as part:
            part.write_text(yaml.safe_dump(dict(plan)), encoding="utf-8")
    earlier = load_document(file)
    for name, value in plan.items():
        if (before := earlier.get(name, "")) != value:
            known = f"with {name} {before}: continue it with --{name} {before}"
            none = f"without --{name}: continue it without"
            raise UsageError(
                f"{folder} is being made {known if before != '' else none}, or choose another "
                "folder"
            )


@cache
def content() -> Any:
    """The engine, the solvers and the items by family."""
    return yaml.safe_load(ITEMS.read_text("utf-8"))


def _templates() -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Names and templates of ever more items: the first of each family, then the second ones."""
    rounds = {family: cycle(templates) for family, templates in content()["items"].items()}
    for number in count(1):
        for family, templates in rounds.items():
            yield f"{family}-{number}", next(templates)


def _read_machines(folder: Path) -> tuple[Machine, ...]:
    """All different machines in a folder, by file; raises UsageError if there is none."""
    with os_errors(f"cannot read {folder}"):
        files = (file for file in sorted(folder.rglob("*.json")) if file.is_file())
        texts = [file.read_text("utf-8", "replace") for file in files]
    read = (read_machine(text, tuple(library())).machine for text in texts)
    if machines := tuple(dict.fromkeys(machine for machine in read if machine)):
        return machines
    raise UsageError(
        f"there is no machine in {folder}: name a directory with .json files of machines"
    )


def _draw(
    folder: Path,
    name: str,
    template: Mapping[str, Any],
    seed: int,
    simulations: int,
    workers: int,
    known: Sequence[Machine] = (),
) -> _Drawn:
    """An item that is neither trivial nor impossible, or the best of the draws."""
    found: list[_Drawn] = []
    for number, changes, task in _draws(template, f"{seed}/{name}"):
        greatest, trials = task.brief.greatest, len(task.trials(0))
        scores, best = dict[str, float](), dict[str, str]()
        for solver, document in _documents(changes, seed, max(FEWEST, simulations // trials)):
            if solver == "par" and greatest and _share(scores, greatest) > TRIVIAL:
                break  # whatever its par would be
            run = _solve(folder / MAKING, f"{name}.{number}.{solver}", document, workers)
            scores[solver] = run.verified_score or 0.0
            if machine := best_machine(run):
                best[solver] = machine.to_text()
        if reached := asyncio.run(_best_of(known, task, workers)):
            scores["known"], best["known"] = reached
        floor, solver = scores["floor"], max(scores, key=scores.__getitem__)
        # without partial scores, an impossible item looks like a hard one
        possible = 0.0 if changes.get("workflow") else greatest or 0.0
        for par, reached_by in ((scores[solver], best.get(solver)), (possible, None)):
            if par <= floor or par < LUCK * (greatest or 0.0):
                continue
            share = _share(scores, par)
            found.append(_Drawn(changes, Par(floor=floor, par=par), share, reached_by))
            if share <= TRIVIAL:
                return found[-1]
    if not found:
        raise UsageError(
            f"{name}: nothing in {DRAWS} draws scored more than random machines: choose another "
            "seed, or more simulations, and another folder"
        )
    return min(found, key=lambda item: item.reached)


async def _best_of(
    machines: Sequence[Machine], task: Task, workers: int
) -> tuple[float, str] | None:
    """Verified score and text of the best of the machines that are valid for a task, if one scores;
    with the random seed of a benchmark's runs, 0."""
    valid = [machine for machine in machines if check(machine, task.brief).task_valid]
    if not valid:
        return None
    async with RolloutPool(workers) as pool:
        rollouts = await asyncio.gather(*(pool.run(machine, task) for machine in valid))
        plain = {m: rollout.score for m, rollout in zip(valid, rollouts, strict=True)}
        scoring = [machine for machine in valid if plain[machine]]
        ranked = sorted(scoring, key=lambda machine: plain[machine] or 0.0, reverse=True)[:VERIFIED]
        found = [await verify_async(m, task, partial(pool.run, m, task)) for m in ranked]
    broken = [m for m, score in plain.items() if score is None]
    broken += [m for m, one in zip(ranked, found, strict=True) if one.score is None]
    if broken:
        raise RunError(
            f"{task.name}: a simulation of the known machine {broken[0].digest} timed out or "
            "crashed, so there is no par; give the same command again, or take it out of --machines"
        )
    scored = [(v.score, m.to_text()) for m, v in zip(ranked, found, strict=True) if v.score]
    return max(scored, default=None)


def _share(scores: Mapping[str, float], par: float) -> float:
    """Share of a par that first machines reach; 1 if it is not above the floor."""
    floor = scores["floor"]
    return (scores["first"] - floor) / (par - floor) if par > floor else 1.0


def _draws(template: Mapping[str, Any], seed: str) -> Iterator[tuple[int, dict[str, Any], Task]]:
    """Numbered changes of an item with their tasks, without those that make none: a target over a
    hole, say."""
    fitting = 0
    for number in range(10 * DRAWS):
        changes = draw_numbers(template, Random(f"{seed}/{number}"))
        knobs = {key: value for key, value in changes.items() if key not in ("task", "workflow")}
        try:
            task = get_task(changes["task"], knobs, content()["engine"])
        except ConfigError:
            continue
        fitting += 1
        yield number, changes, task
        if fitting == DRAWS:
            return


def _documents(
    changes: Mapping[str, Any], seed: int, simulations: int
) -> Iterator[tuple[str, dict[str, Any]]]:
    """The configuration of each solver."""
    own = changes.get("workflow")
    for solver, settings in content()["solvers"].items():
        document = {"engine": content()["engine"], "seed": seed, "model": {"name": PROCEDURAL}}
        given = {"settings.max_simulations": simulations, **settings}
        if own:  # machines of another kind, which their own workflow makes
            first = WORKFLOWS[own].baseline if solver == "floor" else own
            given = {"workflow": first, "settings.placements": given["settings.max_simulations"]}
        for key, value in {**changes, **given}.items():
            document = set_key(document, key, value)
        yield solver, document


def _solve(folder: Path, name: str, document: Mapping[str, Any], workers: int) -> RunResult:
    """The result of a run, which is continued where it exists."""
    path = folder / name
    if path.exists():
        run = resume(path)
    else:
        run = design(build_config({**document, "workers": workers}), folder, name=name)
    if run.score and run.verified_score is None:
        raise RunError(f"{path}: a simulation of its verification failed: delete it, and continue")
    return run
