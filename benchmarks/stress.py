"""Simulates random valid machines on all tasks and reports every unsound result.

    python benchmarks/stress.py [--machines 2000] [--workers 2] [--seed 0] [--engine auto]

A sound result is typed and has only finite numbers. Prints the number of results per status, the
slowest rollouts, the final memory of the workers, and every fault; exit status 1 if there are any.
"""

from __future__ import annotations

import argparse
import asyncio
import itertools
import json
import sys
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from random import Random

import numpy as np

from agentflow.env.archive import rollout_json
from agentflow.env.physics.engine import AUTO
from agentflow.env.pool.pool import RolloutPool
from agentflow.env.rollout import Rollout
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.registry import get_task, task_names
from agentflow.machine.edits.random import random_machine
from agentflow.machine.tree import Machine

SCORED = {"ok", "invalid", "diverged"}


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--machines", type=int, default=2000)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--engine", default=AUTO)
    options = parser.parse_args()
    sys.exit(bool(stress(options.machines, options.workers, options.seed, options.engine)))


def stress(count: int, workers: int, seed: int, engine: str) -> int:
    """Simulate this many machines, print what was found, and return the number of faults."""
    return asyncio.run(_run(count, workers, seed, engine))


def cases(count: int, seed: int = 0, engine: str = AUTO) -> Iterator[tuple[str, Task, Machine]]:
    """Name, task and machine of each case: alternating between tasks, each machine from its own
    seed.

    A task with ten trials only takes part in every tenth round, starting with the first, so every
    task takes about the same number of rollouts.
    """
    tasks = [get_task(name, engine=engine) for name in task_names()]
    rounds = ((turn, task) for turn in itertools.count() for task in tasks)
    due = (task for turn, task in rounds if turn % len(task.trials(seed)) == 0)
    for number, task in enumerate(itertools.islice(due, count)):
        machine = random_machine(Random(f"{seed}/{number}"), task.brief)
        yield f"{number} {task.name}", task, machine


def faults(rollout: Rollout) -> list[str]:
    """Faults of a result; [] if it is sound."""
    found = []
    if (rollout.score is not None) != (rollout.status in SCORED):
        found.append(f"score {rollout.score} with status {rollout.status}")
    if rollout.status == "invalid":
        found.append(f"a valid machine is rejected: {rollout.feedback.text}")
    try:
        json.dumps(rollout_json(rollout), allow_nan=False)
    except ValueError as error:
        found.append(f"result: {error}")
    # a machine that diverges while settling has no trace
    traced = {"ok": (True,), "diverged": (True, False)}.get(rollout.status, (False,))
    if (rollout.trace is not None) not in traced:
        found.append(f"trace {rollout.trace is not None} with status {rollout.status}")
    for name, values in vars(rollout.trace).items() if rollout.trace else ():
        if not isinstance(values, np.ndarray) or values.dtype.kind != "f" or name == "utilisation":
            continue
        sound = np.isfinite(values).all(axis=0)
        if name in ("pull", "work"):  # nan for all two-ended blocks but springs and winches
            sound |= np.isnan(values).all(axis=0)
        if not sound.all():
            found.append(f"{name} is not finite")
    return found


async def _run(count: int, workers: int, seed: int, engine: str) -> int:
    began = time.perf_counter()
    bad: list[str] = []
    statuses: Counter[str] = Counter()
    slowest: list[tuple[float, str]] = []
    free = asyncio.Semaphore(2 * workers)

    async def one(pool: RolloutPool, name: str, task: Task, machine: Machine) -> None:
        try:
            rollout = await pool.run(machine, task)
        finally:
            free.release()
        statuses[f"{rollout.status}{', something broke' if rollout.broken else ''}"] += 1
        bad.extend(f"{name}: {fault}" for fault in faults(rollout))
        slowest.append((rollout.wall_seconds or 0.0, f"{name}, {len(machine)} blocks"))
        slowest.sort(reverse=True)
        del slowest[3:]

    async with RolloutPool(workers) as pool:
        running = []
        for name, task, machine in cases(count, seed, engine):
            await free.acquire()
            running.append(asyncio.create_task(one(pool, name, task, machine)))
        await asyncio.gather(*running)
        memory = [_memory(pid) for pid in pool.pids]
    print(f"{count} machines over {len(task_names())} tasks in {time.perf_counter() - began:.0f} s")
    for status, times in statuses.most_common():
        print(f"  {status:24s} {times:6d}")
    print("slowest: " + "; ".join(f"{seconds:.2f} s ({name})" for seconds, name in slowest))
    print("memory of the workers: " + ", ".join(f"{size:.1f} MB" for size in memory))
    print(f"{len(bad)} faults", *bad, sep="\n  ")
    return len(bad)


def _memory(pid: int) -> float:
    """Resident memory of a process, MB."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return next(float(line.split()[1]) for line in lines if line.startswith("VmRSS:")) / 1024


if __name__ == "__main__":
    main()
