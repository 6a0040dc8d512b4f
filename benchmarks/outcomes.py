"""Finds designs for `app/diagnose/outcome.yaml`: what each does, where both engines agree.

Usage: python -m benchmarks.outcomes [--count 60]
"""

from __future__ import annotations

import argparse
import asyncio
from collections import defaultdict
from itertools import product

from agentflow.app.diagnose.outcome import STAND, TESTS, Outcome, draw_edited
from agentflow.app.diagnose.question import Question

ENGINES = ("pybullet", "mujoco")
VERBS = {"movement": (STAND, "drive"), "throwing": (STAND, "throw")}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=60, help="designs of each level")
    count = parser.parse_args().count
    names = [(level, f"{level}-{number}") for level in VERBS for number in range(count)]
    asked = [
        Question(name, draw_edited(name), None, [level, verb])
        for level, name in names
        for verb in VERBS[level]
    ]
    judged = [asyncio.run(Outcome(engine, 0).judge(asked, 2)) for engine in ENGINES]
    found: dict[tuple[str, bool], list[str]] = defaultdict(list)
    for first, second in zip(*judged, strict=True):
        if first.truth is not None and first.truth == second.truth:
            ((verb, does),) = first.truth.items()
            found[verb, does].append(first.label)
    for verb, does in product((STAND, *TESTS), (True, False)):
        print(f"{verb}, {'yes' if does else 'no'}: {', '.join(found[verb, does])}")


if __name__ == "__main__":
    main()
