"""How much search gains from the simulator's time step, and what finer steps cost.

    python benchmarks/step_errors.py find MACHINES.jsonl [--climbs 36] [--rollouts 300] [--seed 0]
    python benchmarks/step_errors.py measure MACHINES.jsonl
    python benchmarks/step_errors.py cost [--machines 100] [--repeats 4] [--seed 0]

`find` runs hill climbing on throwing, jumping and movement, alternating, from the machines in
tests/machines, and writes the last machines that were the best of a climb. `measure` simulates each
at the default rate and at 480 Hz and prints the share of machines whose scores differ by at most 10
%; machines that score 0 at both rates are left out. `cost` compares the CPU time of rollouts with
that of rollouts in which no step is divided: reference machines on their levels, and machines of
the procedural model and random machines on all levels, as searches without a language model
simulate them; of a level with several trials, only the first.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import multiprocessing
import sys
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from itertools import chain, cycle
from math import inf
from pathlib import Path
from random import Random
from statistics import fmean, median
from typing import Any

from climbing import Found, OneJump, climb
from shelf import FOLDER, families, load, read

from agentflow.agents.base import AskContext, ask
from agentflow.agents.designer import Designer
from agentflow.env.constants import Constants, constants
from agentflow.env.physics.pybullet.engine import PyBulletEngine
from agentflow.env.rollout import Rollout
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.families.jumping import Jumping
from agentflow.env.tasks.registry import get_task, task_names
from agentflow.llm.messages import Sampling
from agentflow.llm.procedural import ProceduralClient
from agentflow.machine.brief import LONE_ROOT
from agentflow.machine.edits.random import random_machine
from agentflow.machine.formats.parse import read_machine
from agentflow.machine.tree import Machine
from agentflow.machine.validity import check
from agentflow.prompts.render import PromptSet

FAMILIES = {"throwing": "reach", "jumping": "root_beyond", "movement": None}
"""Family, and the score term that breaks ties."""
FINE = 480.0
"""Hz."""
NEAR = 0.1
KEPT = 12
"""Most machines of one climb."""
Case = tuple[Machine, Task]
Engines = list[tuple[Constants, PyBulletEngine]]


def main() -> None:
    """Run one of the commands."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(dest="command", required=True)
    find = commands.add_parser("find")
    find.add_argument("--climbs", type=int, default=36)
    find.add_argument("--rollouts", type=int, default=300)
    find.add_argument("--seed", type=int, default=0)
    measure = commands.add_parser("measure")
    cost = commands.add_parser("cost")
    cost.add_argument("--machines", type=int, default=100)
    cost.add_argument("--repeats", type=int, default=4)
    cost.add_argument("--seed", type=int, default=0)
    for command in (find, measure):
        command.add_argument("file", type=Path)
        command.add_argument("--workers", type=int, default=2)
    args = parser.parse_args()
    if args.command == "cost":
        _cost(args.machines, args.repeats, args.seed)
        return
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


# --- what finer steps cost ------------------------------------------------------------------


def _cost(count: int, repeats: int, seed: int) -> None:
    """Print the CPU time of rollouts with and without finer steps, for each kind of machine."""
    undivided = constants().changed({"fine_rate": 0.0, "settle_rate": 0.0})
    engines = [(each, PyBulletEngine(each)) for each in (undivided, constants())]
    kinds = {
        "references": list(_references()),
        "procedural model": asyncio.run(_procedural(count, seed)),
        "random machines": list(_random(count, seed)),
    }
    print("machines           number   undivided, ms   divided, ms   mean rollout   mean   median")
    for kind, cases in kinds.items():
        found = [_time(case, engines, repeats) for case in cases]
        whole, divided = (fmean(times) for times in zip(*found, strict=True))
        ratios = [b / a for a, b in found]
        gains = [
            f"{100 * (x - 1):+.0f} %" for x in (divided / whole, fmean(ratios), median(ratios))
        ]
        print(f"{kind:18s} {len(found):6d} {1e3 * whole:15.1f} {1e3 * divided:13.1f}", *gains)


def _time(case: Case, engines: Engines, repeats: int) -> list[float]:
    """CPU seconds of the first trial with each engine, in turns; the fastest of each."""
    machine, task = case
    trial, least = task.trials(0)[0], [inf] * len(engines)
    for _ in range(repeats):
        for i, (physics, engine) in enumerate(engines):
            began = time.process_time()
            simulate(machine, trial, engine=engine, physics=physics)
            least[i] = min(least[i], time.process_time() - began)
    return least


def _references() -> Iterator[Case]:
    for item in chain.from_iterable(read(family).references for family in families()):
        yield load(item.machine), get_task(item.level)


async def _procedural(count: int, seed: int) -> list[Case]:
    """Valid first designs; of gearing there are none."""
    prompts, client, cases = PromptSet(), ProceduralClient(seed, [Designer.script]), list[Case]()
    for number, task in enumerate(cycle(_tasks())):
        context = AskContext(client, prompts, Sampling(seed=seed + number))
        given = Designer.sample(task.brief, LONE_ROOT)
        design = (await ask(Designer(), given, context, f"designer/{number}")).output
        if design is not None:
            cases.append((design.machine, task))
        if len(cases) == count:
            break
    return cases


def _random(count: int, seed: int) -> Iterator[Case]:
    for number, task in zip(range(count), cycle(_tasks())):
        yield random_machine(Random(f"{seed}/{number}"), task.brief), task


def _tasks() -> list[Task]:
    """All levels on which machines are designed, not completed."""
    tasks = map(get_task, task_names())
    return [task for task in tasks if task.brief.given == LONE_ROOT]


if __name__ == "__main__":
    sys.exit(main())
