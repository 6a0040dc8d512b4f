"""Profiles a whole design run: rollouts in the workers, and the code around them.

    python benchmarks/design.py [--task throwing] [--seed 0]

Prints the wall time of the run, the CPU time of the workers (physics and start-up) and of the main
process (prompts, model, parsing, search, recording), and the most expensive functions of the main
process.
"""

from __future__ import annotations

import argparse
import cProfile
import pstats
import resource
import tempfile
import time
from pathlib import Path

from agentflow.app.design.run import RunOptions, design
from agentflow.config.run import build_config


def cpu_seconds(who: int) -> float:
    """CPU time of this process, or of its children that have ended."""
    usage = resource.getrusage(who)
    return usage.ru_utime + usage.ru_stime


def main() -> None:
    """Run once and print the times."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--task", default="throwing")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    config = build_config({"task": options.task, "seed": options.seed})
    own, profile = cpu_seconds(resource.RUSAGE_SELF), cProfile.Profile()
    began = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        profile.enable()
        result = design(config, Path(folder), RunOptions(print))
        profile.disable()
    wall = time.perf_counter() - began
    own = cpu_seconds(resource.RUSAGE_SELF) - own
    workers = cpu_seconds(resource.RUSAGE_CHILDREN)
    print(f"score {result.score:.2f}, {result.calls} calls, {result.rollouts} rollouts")
    print(f"wall {wall:.1f} s; workers {workers:.1f} s, main process {own:.1f} s (profiled)")
    print(f"workers' share: {workers / (workers + own):.0%}")
    print(f"per rollout {workers / result.rollouts:.3f} s, per call {own / result.calls:.3f} s")
    pstats.Stats(profile).sort_stats("tottime").print_stats(12)


if __name__ == "__main__":
    main()
