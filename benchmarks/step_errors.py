"""How much search gains from the simulator's time step.

    python benchmarks/step_errors.py find MACHINES.jsonl [--climbs 36] [--rollouts 300] [--seed 0]
    python benchmarks/step_errors.py measure MACHINES.jsonl

`find` climbs hills on throwing, jumping and movement in turn, from the machines in tests/machines,
and writes the last machines that were the best of a climb. `measure` simulates each at the default
rate and at 480 Hz and prints the share of machines whose scores differ by at most 10 %; machines
that score 0 at both rates are left out.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import multiprocessing
import sys
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from random import Random
from typing import Any

from climbing import Found, OneJump, climb
from shelf import FOLDER, load, read

from agentflow.env.constants import constants
from agentflow.env.rollout import Rollout
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.families.jumping import Jumping
from agentflow.env.tasks.registry import get_task
from agentflow.machine.formats.parse import read_machine
from agentflow.machine.tree import Machine
from agentflow.machine.validity import check

FAMILIES = {"throwing": "reach", "jumping": "root_beyond", "movement": None}
"""Family, and the score term that breaks ties."""
FINE = 480.0
"""Hz."""
NEAR = 0.1
KEPT = 12
"""Most machines of one climb."""


def main() -> None:
    """Run one of the two commands."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(dest="command", required=True)
    find = commands.add_parser("find")
    find.add_argument("--climbs", type=int, default=36)
    find.add_argument("--rollouts", type=int, default=300)
    find.add_argument("--seed", type=int, default=0)
    measure = commands.add_parser("measure")
    for command in (find, measure):
        command.add_argument("file", type=Path)
        command.add_argument("--workers", type=int, default=2)
    args = parser.parse_args()
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(args.workers, spawn) as pool:
        if args.command == "find":
            work = partial(_climb, rollouts=args.rollouts, seed=args.seed)
            with args.file.open("w", encoding="utf-8") as file:
                for rows in pool.map(work, range(args.climbs)):
                    for row in rows:
                        print(json.dumps(row), file=file, flush=True)
                        print(row["family"], row["climb"], row["rollouts"], f"{row['score']:.2f}")
        else:
            lines = args.file.read_text(encoding="utf-8").splitlines()
            _report(list(pool.map(_measure, map(json.loads, lines))))


def _climb(number: int, rollouts: int, seed: int) -> list[dict[str, Any]]:
    """The machines that a climb found, without the one that it began with."""
    family = list(FAMILIES)[number % len(FAMILIES)]
    rng, task = Random(f"{seed} {number}"), get_task(family)
    if isinstance(task, Jumping):
        task = OneJump(**vars(task))
    steps: list[tuple[int, Found]] = []

    def record(count: int, found: Found) -> None:
        steps.append((count, found))

    start = rng.choice(_starts(family, task))
    asyncio.run(climb(task, rollouts, rng, start, FAMILIES[family], record))
    return [
        {
            "family": family,
            "climb": number,
            "rollouts": count,
            "score": found.value[0],
            "machine": found.machine.to_json(),
        }
        for count, found in steps[1:][-KEPT:]
    ]


def _starts(family: str, task: Task) -> list[Machine]:
    """References of the family, and the machines directly in the folder, as far as valid."""
    files = {each.machine for each in read(family).references}
    files |= {path.name for path in FOLDER.glob("*.json")}
    machines = [load(file) for file in sorted(files)]
    return [machine for machine in machines if check(machine, task.brief).task_valid]


def _measure(row: dict[str, Any]) -> tuple[str, Rollout, Rollout]:
    machine, task = read_machine(row["machine"]).machine, get_task(row["family"])
    return row["family"], *(simulate(machine, task, rate=rate) for rate in (None, FINE))


def _report(found: list[tuple[str, Rollout, Rollout]]) -> None:
    near: Counter[str] = Counter()
    whole: Counter[str] = Counter()
    print(f"{'family':10s} {'default':>8s} {'480 Hz':>8s} {'differs':>8s}  breaks  status")
    for family, usual, fine in sorted(found, key=lambda each: (each[0], -(each[1].score or 0))):
        a, b = usual.score or 0.0, fine.score or 0.0
        if a == b == 0.0:
            continue
        differs = abs(a - b) / max(abs(b), 1e-9)
        close = differs <= NEAR
        near[family] += close
        whole[family] += 1
        print(
            f"{family:10s} {a:8.2f} {b:8.2f} {100 * min(differs, 99):7.1f}%  "
            f"{len(usual.broken)}/{len(fine.broken)}     {'' if close else 'far'}"
        )
    for family, count in whole.items():
        print(f"{family}: {near[family]} of {count} within {100 * NEAR:g} %")
    total, good = sum(whole.values()), sum(near.values())
    print(f"all: {good} of {total} = {100 * good / total:.1f} % ({constants()['step_rate']:g} Hz)")


if __name__ == "__main__":
    sys.exit(main())
