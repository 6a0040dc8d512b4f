"""Profiles a whole design run: rollouts in the workers, and the Python code around them.

    python benchmarks/design.py [--task throwing] [--seed 0]

Prints the wall time of the run, the processor time of the workers (physics, start included) and of
the main process (prompts, model, parsing, search, record), and the functions that cost the main
process most.
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


def processor_seconds(who: int) -> float:
    """User and system time of this process, or of the children that have ended."""
    usage = resource.getrusage(who)
    return usage.ru_utime + usage.ru_stime


def main() -> None:
    """Run once and print the shares."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--task", default="throwing")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    config = build_config({"task": options.task, "seed": options.seed})
    own, profile, began = (
        processor_seconds(resource.RUSAGE_SELF),
        cProfile.Profile(),
        time.perf_counter(),
    )
    with tempfile.TemporaryDirectory() as folder:
        profile.enable()
        result = design(config, Path(folder), RunOptions(print))
        profile.disable()
    wall = time.perf_counter() - began
    own = processor_seconds(resource.RUSAGE_SELF) - own
    workers = processor_seconds(resource.RUSAGE_CHILDREN)
    print(f"score {result['score']:.2f}, {result['calls']} calls, {result['rollouts']} rollouts")
    print(f"wall {wall:.1f} s; workers {workers:.1f} s, main process {own:.1f} s (profiled)")
    print(f"share of the workers: {workers / (workers + own):.0%}")
    print(
        f"per rollout {workers / result['rollouts']:.3f} s, per call {own / result['calls']:.3f} s"
    )
    pstats.Stats(profile).sort_stats("tottime").print_stats(12)


if __name__ == "__main__":
    main()
