"""Measures the physics engines side by side: speed, exactness, agreement, soundness.

    python benchmarks/engines.py [part ...] [--rollouts 2000] [--machines 200] [--workers 1]

Runs all parts, or the named ones, and prints a table with each value, its limit, and whether it is
met; exit status 1 if one is not. All values of the table are from one run on one computer. Speeds
are per second of CPU time of one process, the engines in turns.
"""

from __future__ import annotations

import argparse
import os
import platform
import sys
import time
from collections.abc import Callable, Iterator

from alike import (
    agreement,
    cheats,
    convergence,
    fidelity,
    ranking,
    references,
)
from exact import determinism, memory, soundness, splits, stacks
from figures import Figure, Options
from floor import floor
from rates import pools, speed, worlds

from agentflow.env.constants import constants
from agentflow.env.physics.engines import installed_engines

PARTS: dict[str, Callable[[Options], Iterator[Figure]]] = {
    "speed": speed,
    "floor": floor,
    "worlds": worlds,
    "pools": pools,
    "splits": splits,
    "stacks": stacks,
    "agreement": agreement,
    "fidelity": fidelity,
    "references": references,
    "cheats": cheats,
    "ranking": ranking,
    "convergence": convergence,
    "determinism": determinism,
    "memory": memory,
    "soundness": soundness,
}


def main() -> None:
    """Print the table as it grows."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("parts", nargs="*", choices=[*PARTS, []], help="all by default")
    parser.add_argument("--rollouts", type=int, default=2000, help="of memory and soundness")
    parser.add_argument("--machines", type=int, default=200, help="per family of ranking")
    parser.add_argument("--repeats", type=int, default=7, help="of speed")
    parser.add_argument("--workers", type=int, default=1)
    given = parser.parse_args()
    options = Options(given.rollouts, given.machines, given.repeats, given.workers)
    names = " and ".join(str(spec.identity) for spec in installed_engines())
    print(f"{names}; constants {constants().digest}; Python {platform.python_version()}")
    print(f"{platform.system()} {platform.machine()}, load average {os.getloadavg()[0]:.1f}\n")
    print("| what | value | limit | met |\n|---|---|---|---|")
    missed = 0
    for name in given.parts or PARTS:
        began = time.process_time()
        for figure in PARTS[name](options):
            print(figure.row, flush=True)
            missed += not figure.met
        spent = time.process_time() - began
        print(f"{name}: {spent:.0f} s of CPU time", file=sys.stderr, flush=True)
    print(f"\n{missed} limits missed")
    sys.exit(int(missed > 0))


if __name__ == "__main__":
    main()
