"""Shows that a change of the code leaves rollouts as they were, on random and shipped machines.

    python benchmarks/unchanged.py record FILE [--machines 500]     with the code before
    python benchmarks/unchanged.py compare FILE [--machines 500]    with the code after

Simulates random machines of all tasks, and the machines of `tests/machines`, on every installed
engine, and keeps of each rollout a hash of its digest, score, terms and breakages; one of contacts
and loads; one of the texts about it. `compare` goes through them in the opposite order, prints
which differ, and has the exit status 1 if any of the first two do.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from shelf import FOLDER, load
from stress import cases

from agentflow.env.physics.engine import Engine
from agentflow.env.physics.engines import choose_engine, installed_engines
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.registry import get_task
from agentflow.machine.tree import Machine

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
    options = parser.parse_args()
    found = [*_cases(options.machines)]
    if options.what == "record":
        options.file.write_text(json.dumps(_simulate(found)))
        return
    known = json.loads(options.file.read_text())
    differ = Counter[str]()
    now = _simulate(found[::-1])
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


def _simulate(found: list[Case]) -> dict[str, list[str]]:
    hashes = {}
    for spec in installed_engines():
        engine = choose_engine(spec.name).start()
        for name, task, machine in found:
            hashes[f"{name} on {spec.name}"] = _hashes(task, machine, engine)
        engine.close()
    return hashes


def _hashes(task: Task, machine: Machine, engine: Engine) -> list[str]:
    rollout = simulate(machine, task, engine=engine, cpu_limit=1e9)
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
