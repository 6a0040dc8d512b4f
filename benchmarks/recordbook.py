"""What records are for, the files that hold them, and the machines known so far."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

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

FOLDER = Path(records.__file__).parent / records.FOLDER
BENCHMARK = Path(__file__).parent.parent / "configs" / "benchmark.yaml"


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
        if plain is None or verified is None or low is None or found.holding is None:
            return None
        scores = {name: rollout.score or 0.0 for name, rollout in found.rollouts.items()}
        return TaskRecord(
            task=self.level,
            knobs=dict(self.knobs),
            seed=self.seed,
            score=round(plain, DIGITS),
            verified=round(verified, DIGITS),
            low=round(low, DIGITS),
            of=found.holding.of,
            fails={name: round(scores[name], DIGITS) for name in found.holding.fails},
            how=how,
            platform=here(),
            blocks=tuple(step.to_json() for step in machine),
            controls=tuple(control.to_json() for control in machine.controls),
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


@dataclass(frozen=True)
class Known:
    """A known machine."""

    machine: Machine
    family: str
    how: str
    """How it was found."""

    def fits(self, target: Target) -> bool:
        """Whether it was made for the family and is valid."""
        task = target.task
        return self.family == task.family and check_machine(self.machine, task.brief).task_valid


def own_machines() -> Iterator[Known]:
    """The machines of records and references."""
    for record in read_records().values():
        yield Known(record.machine, get_level(record.task).file.family, record.how)
    for family in families():
        for item in read(family).references:
            how = f"reference {Path(item.machine).stem}, {item.how.partition(':')[0]}"
            yield Known(load(item.machine), family, how)


def recorded_machines(folders: Iterable[Path]) -> Iterator[Known]:
    """The machines of recorded runs."""
    for folder in folders:
        for file in sorted(folder.glob("**/machines/*.json")):
            run = json.loads((file.parent.parent / "result.json").read_text(encoding="utf-8"))
            who = run["model"].replace("large-language-model", "strong language model (recorded)")
            how = f"{who}, {run['workflow']} on {run['task']}"
            yield Known(load_file(file), run["task"].partition("/")[0], how)


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
        f"{record.verified:8.2f}  lowest {record.low:8.2f}  "
        f"{len(record.blocks):3d} blocks  {record.holding}  {record.how}"
    )
