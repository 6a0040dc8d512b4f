"""Feeds mutated replies to every parser and reports the outcomes.

    python benchmarks/fuzz.py [--count 100000] [--seed 1]

Exits with status 1 if any outcome is untyped or takes more than 100 ms per 100,000 characters.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))

from tests.agents.fuzz import fault, outcomes


def main() -> int:
    """Run and print the counts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    read: Counter[str] = Counter()
    codes: Counter[str] = Counter()
    faults: list[str] = []
    characters, seconds, slowest = 0, 0.0, 0.0
    for role, text, parsed, took in outcomes(options.count, options.seed):
        read[f"{role}: {'read' if parsed.output is not None else 'refused'}"] += 1
        codes[parsed.code or "none"] += 1
        characters, seconds, slowest = characters + len(text), seconds + took, max(slowest, took)
        if problem := fault(text, parsed, took):
            faults.append(f"{role}: {problem}")
    for name, number in sorted(read.items()):
        print(f"{name:<24} {number}")
    print("codes:", ", ".join(f"{code} {number}" for code, number in codes.most_common()))
    print(
        f"{characters / 1e6:.1f} M characters in {seconds:.1f} s of CPU time, "
        f"{1e5 * seconds / characters * 1e3:.1f} ms per 100,000; slowest {slowest * 1e3:.0f} ms"
    )
    print(f"{len(faults)} faults", *faults[:20], sep="\n")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
