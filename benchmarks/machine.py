"""Times the machine language on 20-block machines: checks, edit steps, import, memory.

    python benchmarks/machine.py [--seconds S]

Prints one table: rates per second of CPU time of one process, and the modules that dominate each.
"""

from __future__ import annotations

import argparse
import cProfile
import json
import os
import resource
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable
from itertools import cycle
from pathlib import Path
from random import Random

from agentflow.machine import Machine, apply_script, check
from agentflow.machine.edits.random import random_machine
from agentflow.machine.formats.bsg_reading import read_bsg
from agentflow.machine.formats.bsg_writing import to_bsg
from agentflow.machine.formats.coordinates import to_coordinates
from agentflow.machine.formats.detect import read_any

BLOCKS, MACHINES, STEPS = 20, 50, 5
PACKAGE = Path(__file__).parent.parent / "agentflow"
IMPORT = """
import time
wall, cpu = time.perf_counter(), time.process_time()
import agentflow.machine
print(time.perf_counter() - wall, time.process_time() - cpu)
"""

Work = Callable[[], object]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=2.0, help="CPU time to spend on each rate")
    seconds = parser.parse_args().seconds
    rng = Random(0)
    machines = [random_machine(rng, size=(BLOCKS, BLOCKS)) for _ in range(MACHINES)]
    print(f"{MACHINES} random machines of {BLOCKS} blocks; load {os.getloadavg()[0]:.1f}")
    texts = [machine.to_text() for machine in machines]
    replies = [f"Here it is:\n```json\n{text}\n```\nIt should work." for text in texts]
    malformed = [f"```json\n{text[:-2]},\n]\n```" for text in texts]
    documents = [json.dumps(to_coordinates(machine)) for machine in machines]
    files = [to_bsg(machine) for machine in machines]
    scripts = [(machine, script(machine, rng)) for machine in machines]
    edits = [lambda m=machine, s=text: apply_script(m, s) for machine, text in scripts]  # type: ignore[misc]
    row("checks, JSON text", checks(texts), seconds)
    row("checks, fenced reply", checks(replies), seconds)
    row("checks, malformed reply", checks(malformed), seconds)
    row("checks, coordinates", checks(documents), seconds)
    row("reads, .bsg", [lambda f=file: read_bsg(f) for file in files], seconds)  # type: ignore[misc]
    row("edit steps", edits, seconds, STEPS)
    draws = [lambda: random_machine(rng, size=(BLOCKS, BLOCKS))]
    row("random machines", draws * 5, seconds)
    wall, cpu = map(min, zip(*(import_times() for _ in range(7)), strict=True))
    print(f"{'import agentflow.machine':30}{1000 * wall:9.0f} ms wall, {1000 * cpu:.0f} ms CPU")
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"{'memory of this process':30}{peak:9.0f} MB")


def checks(texts: list[str]) -> list[Work]:
    """One call per text that parses, checks and reports it."""
    return [lambda t=text: check(read_any(t)).to_json() for text in texts]  # type: ignore[misc]


def script(machine: Machine, rng: Random) -> str:
    """A script of additions, moves and removals that all succeed."""
    lines: list[str] = []
    while len(lines) < STEPS:
        block, parent, face = rng.randrange(BLOCKS), rng.randrange(BLOCKS), rng.randrange(6)
        kind = rng.choice((1, 15, 63))
        end = f"to {parent} in {face}"
        line = rng.choice((f"Add {kind} {end}", f"Move {block} {end}", f"Remove {block}"))
        if apply_script(machine, "\n".join([*lines, line])).success:
            lines.append(line)
    return "\n".join(lines)


def row(name: str, works: list[Work], seconds: float, steps: float = 1.0) -> None:
    """Print how many steps per CPU second these calls make one after another, and what dominates
    them."""
    count = 0
    works[0]()
    turn = cycle(works)
    began = time.process_time()
    while time.process_time() - began < seconds:
        next(turn)()
        count += 1
    rate = steps * count / (time.process_time() - began)
    print(f"{name:30}{rate:9.0f} /s      {dominant(works)}")


def dominant(works: list[Work]) -> str:
    """The modules that take most of the time, with their shares.

    Time in built-in functions counts for the caller.
    """
    profile = cProfile.Profile(time.process_time)
    profile.enable()
    for _ in range(10):
        for work in works:
            work()
    profile.disable()
    own: Counter[str] = Counter()
    for entry in profile.getstats():
        if isinstance(entry.code, str):
            continue
        inner = sum(call.inlinetime for call in entry.calls or () if isinstance(call.code, str))
        own[part(entry.code.co_filename)] += entry.inlinetime + inner
    whole = sum(own.values())
    return ", ".join(f"{name} {time / whole:.0%}" for name, time in own.most_common(4))


def part(filename: str) -> str:
    """Our module that a file is, or the package that it belongs to."""
    path = Path(filename)
    if path.is_relative_to(PACKAGE):
        return path.stem
    if "json_repair" in path.parts:
        return "json_repair"
    return "generated constructors" if filename.startswith("<") else "standard library"


def import_times() -> tuple[float, float]:
    """Wall and CPU seconds that a fresh interpreter takes to import `agentflow.machine`."""
    done = subprocess.run([sys.executable, "-c", IMPORT], capture_output=True, check=True)
    wall, cpu = map(float, done.stdout.split())
    return wall, cpu


if __name__ == "__main__":
    main()
