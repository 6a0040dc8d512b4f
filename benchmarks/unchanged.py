"""Shows that a change of the code leaves rollouts as they were, on random and shipped machines.

    python benchmarks/unchanged.py record FILE [--machines 500]     with the code before
    python benchmarks/unchanged.py compare FILE [--machines 500] [--workers 2]    with that after

Simulates random machines of all tasks, and the machines of `tests/machines`, on every installed
engine, and keeps of each rollout a hash of its digest, score, terms and breakages; one of contacts
and loads; one of the texts about it. `record` takes the steps of MuJoCo one by one; `compare`
takes compiled ones, if the extra `speed` is installed, goes through the machines in the opposite
order, with --workers in a pool of processes, prints which differ, and has the exit status 1 if any
of the first two do.
"""

from __future__ import annotations

import argparse
import asyncio
import hashlib
import json
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from shelf import FOLDER, load
from stress import cases

from agentflow.env.physics.engines import choose_engine, installed_engines
from agentflow.env.pool.pool import AHEAD, RolloutPool
from agentflow.env.rollout import Rollout
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.registry import get_task
from agentflow.machine.tree import Machine
from agentflow.search.concurrency import work_in_order

LIMIT = 3600.0
"""s of computing for a rollout."""
KINDS = ("rollout", "measured", "told")
Case = tuple[str, Task, Machine]


def main() -> None:
    """Record or compare."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("what", choices=["record", "compare"])
    parser.add_argument("file", type=Path)
    parser.add_argument("--machines", type=int, default=500)
    parser.add_argument("--workers", type=int, default=0)
    options = parser.parse_args()
    found = [*_cases(options.machines)]
    if options.what == "record":
        options.file.write_text(json.dumps(_simulate(found, sys.maxsize)))
        return
    known = json.loads(options.file.read_text())
    differ = Counter[str]()
    workers, found = options.workers, found[::-1]
    now = asyncio.run(_pooled(found, workers)) if workers else _simulate(found, 0)
    for name, hashes in now.items():
        for kind, old, new in zip(KINDS, known[name], hashes, strict=True):
            if old != new:
                differ[kind] += 1
                if kind != "told":
                    print(f"{kind} differs: {name}")
    print(f"{len(now)} rollouts; differ:", {kind: differ[kind] for kind in KINDS})
    sys.exit(bool(differ["rollout"] or differ["measured"]))


def _cases(machines: int) -> Iterator[Case]:
    yield from cases(machines)
    for path in sorted(FOLDER.glob("*/*.json")):
        family = path.parent.name
        task = "movement" if family == "common" else family
        yield f"shipped {family}/{path.name}", get_task(task), load(f"{family}/{path.name}")
    for path in sorted(FOLDER.glob("*.json")):
        yield f"shipped {path.name}", get_task("throwing"), load(path.name)


def _simulate(found: list[Case], patience: int) -> dict[str, list[str]]:
    hashes = {}
    for spec in installed_engines():
        engine = choose_engine(spec.name).start()
        engine.patience = patience  # type: ignore[attr-defined]
        for name, task, machine in found:
            rollout = simulate(machine, task, engine=engine, cpu_limit=LIMIT)
            hashes[f"{name} on {spec.name}"] = _hashes(rollout)
        engine.close()
    return hashes


async def _pooled(found: list[Case], workers: int) -> dict[str, list[str]]:
    jobs = [
        (f"{name} on {spec.name}", replace(task, engine=spec.name), machine)
        for spec in installed_engines()
        for name, task, machine in found
    ]
    hashes: dict[str, list[str]] = {}
    async with RolloutPool(workers) as pool:

        async def work(case: Case) -> tuple[str, list[str]]:
            name, task, machine = case
            return name, _hashes(await pool.run(machine, task, cpu_limit=LIMIT))

        await work_in_order(jobs, work, lambda one: hashes.update([one]), AHEAD * workers)
    return hashes


def _hashes(rollout: Rollout) -> list[str]:
    measured = rollout.trace.measured if rollout.trace else None
    own = (rollout.status, rollout.digest, rollout.score, rollout.terms)
    parts = (
        (*own, rollout.broken, rollout.marginal),
        (measured.contacts, measured.peaks) if measured else (),
        (rollout.feedback.text, rollout.feedback.data, rollout.events),
    )
    return [hashlib.sha256(repr(part).encode()).hexdigest()[:16] for part in parts]


if __name__ == "__main__":
    main()
