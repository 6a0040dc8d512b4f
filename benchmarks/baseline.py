"""Compares the procedural model in the hierarchical workflow with random-dsl at equal rollouts.

    python benchmarks/baseline.py [--tasks throwing movement] [--seeds 5] [--set key=value]

For each task and seed, runs the hierarchical workflow with default settings, then random-dsl with
the same number of rollouts. Prints one row per task: mean and best of both, and which is ahead.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
from pathlib import Path
from typing import Any

from agentflow.app.design.run import design
from agentflow.config.run import apply_settings, build_config
from agentflow.env.tasks.registry import get_task, task_names
from agentflow.machine.brief import LONE_ROOT


def score_of(document: dict[str, Any], out: Path) -> tuple[float, int]:
    """Score (0 without a valid machine) and rollouts of a run."""
    result = design(build_config(document), out)
    return result.score or 0.0, result.rollouts


def main() -> None:
    """Run and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    families = [n for n in task_names() if "/" not in n and get_task(n).brief.given == LONE_ROOT]
    parser.add_argument("--tasks", nargs="+", default=families)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--set", dest="settings", action="append", default=[])
    options = parser.parse_args()
    print(f"{'task':<12} {'rollouts':>8} {'procedural':>18} {'random-dsl':>18}  ahead")
    for task in options.tasks:
        ours, theirs, rollouts = list[float](), list[float](), list[int]()
        for seed in range(options.seeds):
            document = apply_settings({"task": task, "seed": seed}, options.settings)
            with tempfile.TemporaryDirectory() as folder:
                score, count = score_of(document, Path(folder))
                budget = [*options.settings, f"max_simulations={count}", "workflow=random-dsl"]
                baseline = apply_settings({"task": task, "seed": seed}, budget)
                theirs.append(score_of(baseline, Path(folder))[0])
            ours.append(score)
            rollouts.append(count)
        cells = [f"{statistics.fmean(s):.2f} (best {max(s):.2f})" for s in (ours, theirs)]
        ahead = "procedural" if statistics.fmean(ours) > statistics.fmean(theirs) else "random-dsl"
        print(
            f"{task:<12} {statistics.fmean(rollouts):>8.0f} {cells[0]:>18} {cells[1]:>18}  {ahead}"
        )


if __name__ == "__main__":
    main()
