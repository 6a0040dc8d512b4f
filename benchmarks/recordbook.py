"""What records are for, the files that hold them, and the machines known so far."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml
from shelf import (
    DIGITS,
    MachineRecord,
    families,
    here,
    load,
    load_file,
    machine_records,
    read,
    read_record,
    scores_text,
)

from agentflow.env.physics.engine import AUTO
from agentflow.env.physics.registry import ENGINES
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.records import MACHINES, scores_file
from agentflow.env.tasks.registry import get_level, get_task, make_task, task_names
from agentflow.env.verification import verify
from agentflow.machine.tree import Machine
from agentflow.machine.validity import check as check_machine

LARGE = r"large.language.model( \(recorded\))?"
"""How results of recorded language models name them."""
HEAD = """\
# Fragile records

This page shows which of the best known machines fail when the simulation changes a little. Use it \
to see how far a record can be trusted, and where a sturdier machine is worth looking for.

A machine is [fragile](../explanation/scores.md#fragile-machines) if its score holds in some \
simulations of its verification but not in all. That is so for {of_levels} of the {levels} records \
of levels, and for {of_items} of the {items} further ones of \
levels with other knobs; names tell the engine where it is not PyBullet. \
`python benchmarks/records.py page` writes this page.

| record | verified score | holds in | scores where it fails |
|---|--:|---|---|
"""


@dataclass(frozen=True)
class Target:
    """What a record is for."""

    name: str
    level: str
    knobs: Mapping[str, Any]
    seed: int = 0
    engine: str = ""
    """The other engine that the record is for; "": that of the first records, the default one."""

    @property
    def file(self) -> str:
        """Path of its file in the folder of records, without suffix."""
        return f"{self.engine}/{self.name}" if self.engine else self.name

    @property
    def task(self) -> Task:
        """The task."""
        return make_task(get_level(self.level), self.knobs, self.engine or AUTO)

    def score(self, machine: Machine) -> float | None:
        """The plain score; None if the machine is invalid here, or could not be simulated."""
        rollout = simulate(machine, self.task, seed=self.seed)
        return None if rollout.status == "invalid" else rollout.score

    def record(self, machine: Machine, how: str) -> MachineRecord | None:
        """The verified machine; None if some simulation failed."""
        found = verify(machine, self.task, seed=self.seed)
        plain, verified, low = found.default.score, found.score, found.low
        if plain is None or verified is None or low is None or found.holding is None:
            return None
        scores = {name: rollout.score or 0.0 for name, rollout in found.rollouts.items()}
        return MachineRecord.build(
            machine,
            name=self.name,
            task=self.level,
            knobs=dict(self.knobs),
            seed=self.seed,
            score=round(plain, DIGITS),
            verified=round(verified, DIGITS),
            low=round(low, DIGITS),
            of=found.holding.of,
            fails={name: round(scores[name], DIGITS) for name in found.holding.fails},
            how=how,
            platform=here(self.engine or AUTO),
        )


def targets(engine: str = "") -> dict[str, Target]:
    """All levels, then the recorded levels with changed knobs, by name of their file."""
    levels = (
        Target(f"{get_task(name).family}-{get_task(name).level}", name, {}, engine=engine)
        for name in task_names()
    )
    found = {target.name: target for target in levels}
    for name, record in (machine_records() | machine_records(engine)).items():
        if record.knobs:
            found[name] = Target(name, record.task, record.knobs, record.seed, engine)
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


def recorders() -> tuple[str, ...]:
    """The engines that have records, as `Target.engine` names them."""
    return ("", *(name for name in ENGINES if (MACHINES / name).is_dir()))


def own_machines() -> Iterator[Known]:
    """The machines of all records and references."""
    for record in (one for name in recorders() for one in machine_records(name).values()):
        yield Known(record.machine, get_level(record.task).file.family, record.how)
    for family in families():
        for item in read(family).references:
            how = f"reference {Path(item.machine).stem}, {item.how.partition(':')[0]}"
            yield Known(load(item.machine), family, how)


def recorded_machines(folders: Iterable[Path], known: Sequence[Known]) -> Iterator[Known]:
    """The machines of recorded runs; of those that verified some, only these. What a run began with
    is looked for among the known machines."""
    for folder in folders:
        for file in sorted(folder.glob("**/result.json")):
            run = json.loads(file.read_text(encoding="utf-8"))
            who = re.sub(LARGE, "strong language model (recorded)", run["model"])
            how = f"{who}, {run['workflow']} on {run['task']}"
            asked = yaml.safe_load((file.parent / "run.yaml").read_text(encoding="utf-8"))
            if start := asked["config"]["settings"].get("start"):
                begun = {item.machine: item.how for item in known}
                origin = begun.get(Machine.from_json(start), "another machine")
                how = f"{how}, {run['rollouts']:,} simulations, from {origin}"
            names = [item["machine"] for item in run.get("finalists", ())] or ["*"]
            for name in names:
                for path in sorted(file.parent.glob(f"machines/{name}.json")):
                    yield Known(load_file(path), run["task"].partition("/")[0], how)


def stored(target: Target) -> MachineRecord | None:
    """The record in the file."""
    file = MACHINES / f"{target.file}.json"
    return read_record(file) if file.exists() else None


def store(target: Target, record: MachineRecord) -> None:
    """Write the record, and its scores into the package; print it."""
    (MACHINES / target.engine).mkdir(exist_ok=True)
    file = MACHINES / f"{target.file}.json"
    file.write_text(record.to_text(), encoding="utf-8")
    scores_file(target.engine).write_text(scores_text(target.engine), encoding="utf-8")
    print(line(target, record), flush=True)


def line(target: Target, record: MachineRecord | None) -> str:
    """A record in one line."""
    good = get_level(target.level).file.good
    if record is None:
        return f"{target.name:24s} good {good:7g}  no record"
    return (
        f"{target.name:24s} good {good:7g}  score {record.score:8.2f}  verified "
        f"{record.verified:8.2f}  lowest {record.low:8.2f}  "
        f"{record.size:3d} blocks  {record.holding}  {record.how}"
    )


def fragile_page(known: Sequence[Target]) -> str:
    """The page of the records whose machines are fragile."""
    known = [target for target in known if stored(target)]
    levels = [target for target in known if not target.knobs]
    rows = [
        f"| `{target.file}` | {record.verified:.2f} | {record.holding.holds} of {record.of} | "
        f"{'; '.join(f'{name}: {score:.2f}' for name, score in record.fails.items())} |"
        for target in known
        if (record := stored(target)) and record.holding.fragile
    ]
    fragile = [record for target in levels if (record := stored(target)) and record.holding.fragile]
    of_levels = len(fragile)
    of_items, items = len(rows) - of_levels, len(known) - len(levels)
    return HEAD.format(of_levels=of_levels, levels=len(levels), of_items=of_items, items=items) + (
        "\n".join(rows) + "\n"
    )
