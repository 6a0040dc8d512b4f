"""Records: the best known machine of each level and of each item of the benchmark.

    python benchmarks/records.py update [NAME ...] [--machines FOLDER ...]
    python benchmarks/records.py find [NAME ...] [--seconds 60] [--seed 0]
    python benchmarks/records.py check [NAME ...]
    python benchmarks/records.py list [NAME ...]

Records are ranked by verified score and stored in agentflow/env/tasks/records, one file each: NAME
is the file's name, for example throwing-3. Every improvement is stored at once, so that a command
that was stopped loses nothing and can be run again.

`update` verifies each record again and compares it with the other known machines of its family:
reference machines, other records, and the machines of recorded runs in the given folders. `find`
climbs hills from the record for some seconds; a step that scores more counts only if its verified
score is higher, too. `check` simulates the records and fails if a score differs from the file.
`list` prints the records.
"""

from __future__ import annotations

import argparse
import json
import random
import sys
import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from climbing import PATIENCE, change
from shelf import DIGITS, families, here, load, load_file, read

from agentflow.config.run import load_document
from agentflow.config.sweep import list_runs, read_sweep
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks import records
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.records import TaskRecord, read_records
from agentflow.env.tasks.registry import get_level, get_task, task_names
from agentflow.env.verification import verify
from agentflow.machine.tree import Machine
from agentflow.machine.validity import check as check_machine

ROOT = Path(__file__).parent.parent
FOLDER = Path(records.__file__).parent / records.FOLDER
BENCHMARK = ROOT / "configs" / "benchmark.yaml"
VERIFIED = 3
"""Candidates of a level that are verified, best plain scores first."""


@dataclass(frozen=True)
class Target:
    """What a record is for."""

    name: str
    level: str
    knobs: Mapping[str, Any]
    seed: int = 0

    @property
    def task(self) -> Task:
        """The task."""
        return get_task(self.level, self.knobs)

    def score(self, machine: Machine) -> float | None:
        """The plain score; None if the machine is invalid here, or could not be simulated."""
        rollout = simulate(machine, self.task, seed=self.seed)
        return None if rollout.status == "invalid" else rollout.score

    def record(self, machine: Machine, how: str) -> TaskRecord | None:
        """The verified machine; None if some simulation failed."""
        found = verify(machine, self.task, seed=self.seed)
        plain, verified, low = found.default.score, found.score, found.low
        if plain is None or verified is None or low is None:
            return None
        return TaskRecord(
            task=self.level,
            knobs=dict(self.knobs),
            seed=self.seed,
            score=round(plain, DIGITS),
            verified=round(verified, DIGITS),
            low=round(low, DIGITS),
            how=how,
            platform=here(),
            blocks=tuple(machine.to_json()),
        )


def targets() -> dict[str, Target]:
    """All levels, then the items of the benchmark with changed knobs, by name of their file."""
    levels = (
        Target(f"{get_task(name).family}-{get_task(name).level}", name, {}) for name in task_names()
    )
    found = {target.name: target for target in levels}
    if BENCHMARK.exists():
        for run in list_runs(read_sweep(load_document(BENCHMARK), str(BENCHMARK))):
            name, config = run.labels["task"], run.config
            if config.knobs:
                found[name] = Target(name, config.task, config.knobs, config.seed)
    return found


def main() -> int:
    """Run one of the commands."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("command", choices=("update", "find", "check", "list"))
    parser.add_argument("names", nargs="*", help="all by default")
    parser.add_argument("--machines", type=Path, action="append", default=[])
    parser.add_argument("--seconds", type=float, default=60)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    known = targets()
    if unknown := [name for name in options.names if name not in known]:
        parser.error(f"unknown record {unknown[0]}; known: {', '.join(known)}")
    chosen = [known[name] for name in options.names or known]
    if options.command == "update":
        machines = {**own_machines(), **dict(recorded_machines(options.machines))}
        for target in chosen:
            update(target, machines)
    elif options.command == "find":
        for target in chosen:
            find(target, options.seconds, random.Random(f"{options.seed} {target.name}"))
    elif options.command == "check":
        wrong = [target.name for target in chosen if not holds(target)]
        return 1 if wrong else 0
    else:
        for target in chosen:
            print(line(target, stored(target)))
    return 0


def own_machines() -> dict[Machine, str]:
    """Machines of the references and records -> how they were found."""
    found = {
        load(item.machine): f"reference {Path(item.machine).stem}, {item.how.partition(':')[0]}"
        for family in families()
        for item in read(family).references
    }
    return {**{record.machine: record.how for record in read_records().values()}, **found}


def recorded_machines(folders: Iterable[Path]) -> Iterator[tuple[Machine, str]]:
    """Machines in the folders `machines` of recorded runs -> how they were found."""
    for folder in folders:
        for file in sorted(folder.glob("**/machines/*.json")):
            run = json.loads((file.parent.parent / "result.json").read_text(encoding="utf-8"))
            who = run["model"].replace("large-language-model", "strong language model (recorded)")
            yield load_file(file), f"{who}, {run['workflow']} on {run['task']}"


def stored(target: Target) -> TaskRecord | None:
    """The record in the file."""
    file = FOLDER / f"{target.name}.json"
    return TaskRecord.model_validate_json(file.read_bytes()) if file.exists() else None


def store(target: Target, record: TaskRecord) -> None:
    """Write the record and print it."""
    FOLDER.mkdir(exist_ok=True)
    (FOLDER / f"{target.name}.json").write_text(record.to_text(), encoding="utf-8")
    print(line(target, record), flush=True)


def line(target: Target, record: TaskRecord | None) -> str:
    """A record in one line."""
    good = get_level(target.level).file.good
    if record is None:
        return f"{target.name:24s} good {good:7g}  no record"
    return (
        f"{target.name:24s} good {good:7g}  score {record.score:8.2f}  verified "
        f"{record.verified:8.2f}  lowest {record.low:8.2f}  {len(record.blocks):3d} blocks  "
        f"{record.how}"
    )


def update(target: Target, machines: Mapping[Machine, str]) -> None:
    """Store the best of the known machines by verified score."""
    old, brief = stored(target), target.task.brief
    valid = [machine for machine in machines if check_machine(machine, brief).task_valid]
    scores = {machine: target.score(machine) or 0.0 for machine in valid}
    ordered = sorted(valid, key=lambda machine: -scores[machine])[:VERIFIED]
    if old is not None and old.machine not in ordered:
        ordered.append(old.machine)
    found = [target.record(machine, machines.get(machine, "")) for machine in ordered]
    best = max((item for item in found if item), key=lambda item: item.verified, default=None)
    if best is None:
        print(line(target, None), flush=True)
    else:
        store(target, best)


def find(target: Target, seconds: float, rng: random.Random) -> None:
    """Climb from the record for some seconds; store every machine with a higher verified score."""
    best = stored(target)
    if best is None:
        print(f"{target.name} has no record to climb from; run update first")
        return
    how = "hill climbing from " + best.how.removeprefix("hill climbing from ")
    brief, end = target.task.brief, time.monotonic() + seconds
    machine, score, idle, tried = best.machine, best.score, 0, 0
    while time.monotonic() < end:
        other = change(machine, brief, rng)
        value = target.score(other) or 0.0
        tried, idle = tried + 1, idle + 1
        if value > best.score:
            better = target.record(other, how)
            if better is None or better.verified <= best.verified:
                continue  # an error of the simulation
            best, idle = better, 0
            store(target, best)
        if value >= score:
            machine, score = other, value
        if idle >= PATIENCE:
            machine, score, idle = best.machine, best.score, 0
    print(f"{target.name}: {tried} machines tried", flush=True)


def holds(target: Target) -> bool:
    """Whether a record has the scores of its file; print what differs."""
    old = stored(target)
    new = old and target.record(old.machine, old.how)
    if old is None or new != old:
        print(f"{line(target, old)}\n  now {line(target, new)}")
    return old is not None and new == old


if __name__ == "__main__":
    sys.exit(main())
