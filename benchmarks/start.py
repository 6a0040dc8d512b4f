"""Start-up time of commands: minimum and median wall and CPU time of a fresh process.

Targets for the minimum: `--help` under 100 ms of CPU time, `check` under 400 ms.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import time
from pathlib import Path

MAIN = "import sys; from agentflow_command import main; sys.exit(main())"
CAR = str(Path(__file__).parents[1] / "examples" / "car.json")
COMMANDS = (
    ("agentflow --help", ["-c", MAIN, "--help"]),
    ("agentflow check car.json", ["-c", MAIN, "check", CAR]),
    ("agentflow tasks", ["-c", MAIN, "tasks"]),
    ("import agentflow", ["-c", "import agentflow"]),
    ("python, nothing else", ["-c", ""]),
)


def time_process(arguments: list[str]) -> tuple[float, float]:
    """Wall and CPU milliseconds of one process."""
    before, began = os.times(), time.perf_counter()
    subprocess.run([sys.executable, *arguments], stdout=subprocess.DEVNULL, check=True)
    wall, after = time.perf_counter() - began, os.times()
    used = after.children_user - before.children_user
    used += after.children_system - before.children_system
    return 1000 * wall, 1000 * used


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--times", type=int, default=15)
    count = parser.parse_args().times
    for name, arguments in COMMANDS:
        walls, used = zip(*(time_process(arguments) for _ in range(count)), strict=True)
        print(
            f"{name:<26} wall {min(walls):4.0f} ms min, {statistics.median(walls):4.0f} median; "
            f"CPU {min(used):4.0f} ms min, {statistics.median(used):4.0f} median"
        )


if __name__ == "__main__":
    main()
