"""Records: the best known machine of each level, and of some levels with other knobs.

    python benchmarks/records.py update [NAME ...] [--machines FOLDER ...]
    python benchmarks/records.py find [NAME ...] [--seconds 60] [--seed 0]
    python benchmarks/records.py check [NAME ...]
    python benchmarks/records.py list [NAME ...]
    python benchmarks/records.py page
    python benchmarks/records.py scores

Records are ranked by verified score, of which a fragile machine loses a tenth: a sturdy one within
10 % replaces it. They are stored in the folder records, one file each: NAME is the
file's name, for example throwing-3. Their scores are in agentflow/env/tasks/records.json as well,
because the package has no machines that solve its tasks. Every improvement is stored at once, so
that a command that was stopped loses nothing and can be run again.

`update` verifies each record again and compares it with the other known machines of its family:
reference machines, other records, and the machines of recorded runs in the given folders. `find`
runs hill climbing from the record for some seconds; a step that scores more counts only if its
verified score is higher, too. Without a record, `find` starts from another machine of the family,
adapted to the budget and the block types. `check` simulates the records and fails if a score
differs from the file. `list` prints the records, and `page` writes which are fragile to
docs/results/records.md. `scores` writes the scores of all into the package, as `update` and `find`
do. `--engine mujoco` means the records of another engine, in a folder with its name, which `update`
compares with all others as well; `page` has them all.
"""

from __future__ import annotations

import argparse
import random
import sys
import time
from collections.abc import Mapping
from pathlib import Path

from adapting import adapt
from climbing import PATIENCE, change
from recordbook import (
    MachineRecord,
    Target,
    fragile_page,
    line,
    own_machines,
    recorded_machines,
    recorders,
    scores_text,
    store,
    stored,
    targets,
)

from agentflow.env.tasks.records import scores_file
from agentflow.machine.tree import Machine

CLIMB = "hill climbing from "
LOSS = 0.1
"""Share of its verified score that a fragile machine loses when records are ranked; chosen."""
PAGE = Path(__file__).parent.parent / "docs" / "results" / "records.md"
VERIFIED = 3
"""Candidates of a level that are verified, best plain scores first."""


def main() -> int:
    """Run one of the commands."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("command", choices=("update", "find", "check", "list", "page", "scores"))
    parser.add_argument("names", nargs="*", help="all by default")
    parser.add_argument("--machines", type=Path, action="append", default=[])
    parser.add_argument("--seconds", type=float, default=60)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--engine", default="")
    options = parser.parse_args()
    known = targets(options.engine)
    if unknown := [name for name in options.names if name not in known]:
        parser.error(f"unknown record {unknown[0]}; known: {', '.join(known)}")
    chosen = [known[name] for name in options.names or known]
    if options.command == "update":
        own = [*own_machines()]
        known_machines = [*recorded_machines(options.machines, own), *own]
        for target in chosen:
            update(target, {item.machine: item.how for item in known_machines if item.fits(target)})
    elif options.command == "find":
        for target in chosen:
            find(target, options.seconds, random.Random(f"{options.seed} {target.name}"))
    elif options.command == "check":
        wrong = [target.name for target in chosen if not holds(target)]
        return 1 if wrong else 0
    elif options.command == "page":
        every = [target for engine in recorders() for target in targets(engine).values()]
        PAGE.write_text(fragile_page(every), encoding="utf-8")
    elif options.command == "scores":
        scores_file(options.engine).write_text(scores_text(options.engine), encoding="utf-8")
    else:
        for target in chosen:
            print(line(target, stored(target)))
    return 0


def update(target: Target, machines: Mapping[Machine, str]) -> None:
    """Store the best of the known machines by verified score."""
    old, greatest = stored(target), target.task.brief.greatest
    scores: dict[Machine, float] = {}
    for machine in ([old.machine] if old else []) + list(reversed(machines)):
        scores.setdefault(machine, target.score(machine) or 0.0)
        if scores[machine] == greatest and not (old and old.holding.fragile):
            break
    ordered = sorted(scores, key=lambda machine: -scores[machine])[:VERIFIED]
    best: MachineRecord | None = None
    for machine in ordered:
        how = old.how if old and machine == old.machine else machines[machine]
        found = target.record(machine, how)
        if found and (best is None or worth(found) > worth(best)):
            best = found
        if best and best.verified == greatest and not best.holding.fragile:
            break
    if best is None:
        print(line(target, None), flush=True)
    else:
        store(target, best)


def find(target: Target, seconds: float, rng: random.Random) -> None:
    """Climb from the record for some seconds; store every machine with a higher verified score.

    Without a record, the climb starts from that of the level, adapted to the item's knobs.
    """
    end = time.monotonic() + seconds
    best = stored(target) or adapt(target, end, rng)
    if best is None:
        print(f"{target.name}: no machine to climb from", flush=True)
        return
    store(target, best)
    how = best.how if best.how.startswith(CLIMB) else CLIMB + best.how
    brief = target.task.brief
    machine, score, idle, tried = best.machine, best.score, 0, 0
    while time.monotonic() < end and worth(best) != brief.greatest:
        other = change(machine, brief, rng)
        value = target.score(other) or 0.0
        tried, idle = tried + 1, idle + 1
        if value > (1 - LOSS * best.holding.fragile) * best.score:
            better = target.record(other, how)
            if better is None or worth(better) <= worth(best):
                continue  # an error of the simulation
            best, idle = better, 0
            store(target, best)
        if value >= score:
            machine, score = other, value
        if idle >= PATIENCE:
            machine, score, idle = best.machine, best.score, 0
    print(f"{target.name}: {tried} machines tried", flush=True)


def worth(record: MachineRecord) -> float:
    """What records are ranked by: the verified score, less for a fragile machine."""
    return (1 - LOSS * record.holding.fragile) * record.verified


def holds(target: Target) -> bool:
    """Whether a record has the scores of its file; print what differs."""
    old = stored(target)
    new = old and target.record(old.machine, old.how)
    if old is None or new != old:
        print(f"{line(target, old)}\n  now {line(target, new)}")
    return old is not None and new == old


if __name__ == "__main__":
    sys.exit(main())
