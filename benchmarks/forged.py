"""Gives damaged and forged run directories to every reader of runs and reports the outcomes.

    python benchmarks/forged.py [--count 2000] [--seed 1]

Exits with status 1 if any outcome is a traceback, a control character or a file outside the run.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))

from tests.runs.fuzz import make_source, summary


def main() -> int:
    """Run and print the counts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as kept, tempfile.TemporaryDirectory() as folder:
        source = make_source(Path(kept))
        began = time.process_time()
        counts, faults = summary(source, Path(folder), options.count, options.seed)
    for name, number in sorted(counts.items()):
        print(f"{name:<24} {number}")
    seconds = time.process_time() - began
    print(f"{options.count} directories in {seconds:.0f} s of CPU time")
    print(f"{len(faults)} faults", *faults, sep="\n")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
