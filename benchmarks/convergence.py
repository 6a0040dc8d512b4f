"""Scores at several step rates, for the machines in tests/machines and the level-1 references of
movement and throwing.

    python benchmarks/convergence.py [--rates 60 120 240 480]

The default rate is the lowest whose scores are within 3 % of 480 Hz for machines that do not break.
Where the score is 0, the boulder's greatest reach is compared instead.
"""

from __future__ import annotations

import argparse
import os
import time
from pathlib import Path

from shelf import FOLDER, load, read

from agentflow.env.constants import constants
from agentflow.env.rollout import Rollout
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.registry import get_task
from agentflow.machine.blocks.library import BOULDER
from agentflow.machine.tree import Machine

NEAR = 0.03


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rates", type=float, nargs="+", default=[60, 120, 240, 480])
    rates = parser.parse_args().rates
    spent = dict.fromkeys(rates, 0.0)
    off: dict[float, list[float]] = {rate: [] for rate in rates}
    head = "".join(f"{f'{rate:g} Hz':>10s}" for rate in rates)
    print(f"{'machine':24s} {'measure':>8s}{head}   breaks   differences from {rates[-1]:g} Hz")
    for name, machine in _machines().items():
        found = []
        for rate in rates:
            began = time.process_time()
            found.append(simulate(machine, _task(machine), rate=rate))
            spent[rate] += time.process_time() - began
        measure = "score" if found[-1].score else "reach"
        values = [_value(rollout, measure) for rollout in found]
        differences = [abs(value / values[-1] - 1) if values[-1] else 0.0 for value in values]
        breaks = [len(rollout.broken) for rollout in found]
        for rate, broken, difference in zip(rates, breaks, differences, strict=True):
            if not broken:
                off[rate].append(difference)
        print(
            f"{name:24s} {measure:>8s}"
            + "".join(f"{value:10.3f}" for value in values)
            + f"   {'/'.join(map(str, breaks)):8s}"
            + " ".join(f"{100 * difference:6.2f} %" for difference in differences[:-1])
        )
    _summary(rates, off, spent)


def _machines() -> dict[str, Machine]:
    """The machines directly in the folder and the level-1 references, by file name."""
    files = {path.name for path in FOLDER.glob("*.json")}
    for family in ("movement", "throwing"):
        files |= {each.machine for each in read(family).references if each.level == family}
    return {Path(file).stem: load(file) for file in sorted(files)}


def _task(machine: Machine) -> Task:
    thrower = any(step.type == BOULDER for step in machine)
    return get_task("throwing" if thrower else "movement")


def _value(rollout: Rollout, measure: str) -> float:
    value = rollout.score if measure == "score" else rollout.terms.get("reach")
    return float(value or 0.0)


def _summary(rates: list[float], off: dict[float, list[float]], spent: dict[float, float]) -> None:
    print("\nmachines that do not break at a rate:")
    for rate in rates:
        near = sum(difference <= NEAR for difference in off[rate])
        print(
            f"{rate:5g} Hz: {near} of {len(off[rate])} within {100 * NEAR:g} %, worst "
            f"{100 * max(off[rate], default=0.0):.2f} %; {spent[rate]:.1f} s of CPU time"
        )
    print(f"default: {constants()['step_rate']:g} Hz; load average {os.getloadavg()[0]:.1f}")


if __name__ == "__main__":
    main()
