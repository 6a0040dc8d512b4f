"""Gives damaged and forged files of every kind to all that reads them, and reports the outcomes.

    python benchmarks/forged.py [--count 10000] [--seed 1] [--seconds 1800] [--state forged]

It ends after the given time at the latest, and the same command goes on from there. Exits with
status 1 if any outcome is a traceback, a signal, a control character or a file outside the run.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))

from tests.runs.fuzz import Outcome, outcomes, summary
from tests.runs.sources import make_sources

CHUNK = 500
"""Mutations of one process, which may die of one."""


def carry_out(state: Path, first: int, end: int, seed: int) -> None:
    """Try mutations in a process of their own; a line of JSON for each reader."""
    sources = make_sources(state / "sources")
    with tempfile.TemporaryDirectory() as folder, (state / "outcomes.jsonl").open("a") as file:
        for item in outcomes(sources, Path(folder), range(first, end), seed):
            file.write(json.dumps(item) + "\n")
            file.flush()


def read_outcomes(state: Path) -> tuple[list[Outcome], int]:
    """What is known so far, without a half-written last line; how many mutations that are."""
    file = state / "outcomes.jsonl"
    lines = file.read_text().split("\n")[:-1] if file.exists() else []
    found = [json.loads(line) for line in lines]
    return found, max((number for number, *_ in found), default=-1) + 1


def main() -> int:
    """Run and print the counts."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=1800)
    parser.add_argument("--state", type=Path, default=Path("forged"))
    options = parser.parse_args()
    options.state.mkdir(exist_ok=True)
    make_sources(options.state / "sources")
    until = time.monotonic() + options.seconds
    found, done = read_outcomes(options.state)
    while done < options.count and time.monotonic() < until:
        given = (options.state, done, min(done + CHUNK, options.count), options.seed)
        process = multiprocessing.get_context("fork").Process(target=carry_out, args=given)
        process.start()
        process.join(max(0.0, until - time.monotonic()))
        if process.is_alive():  # out of time
            process.kill()
            process.join()
        elif process.exitcode:
            told = [read_outcomes(options.state)[1], "", "one of its readers"]
            with (options.state / "outcomes.jsonl").open("a") as file:
                file.write(json.dumps([*told, f"it died: status {process.exitcode}"]) + "\n")
        found, done = read_outcomes(options.state)
    counts, faults = summary(found)
    for name, times in sorted(counts.items()):
        print(f"{name:<40} {times}")
    print(*(text for _, text in faults), sep="\n")
    failed = len({number for number, _ in faults})
    print(f"{done} of {options.count} mutations, {len(found)} readings: {done - failed} held")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
