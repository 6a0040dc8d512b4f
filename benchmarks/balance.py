"""Whether the energy that feedback tells of adds up, on random machines that break.

    python benchmarks/balance.py [--machines 200] [--seed 0]

On MuJoCo, the work of all constraints, dampers and suspensions is integrated here in every step.
With the work that `World.works` tells, and what blocks and objects gain in kinetic energy and in
height, it must give 0. The error is the sum over the work done by or against anything. Part of it
is the engine's own: it adds a little energy where what springs pull flies round fast.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
from figures import MUJOCO

from agentflow.env.constants import constants
from agentflow.env.physics.engines import choose_engine
from agentflow.env.physics.mujoco import world as module
from agentflow.env.simulation.trial import Trial
from agentflow.env.simulation.variations import DEFAULT
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.registry import get_task, task_names
from agentflow.machine.edits.random import random_machine
from agentflow.machine.tree import Machine

sys.path.insert(0, str(Path(__file__).parent.parent))
from tests.env.physics.mujoco.works import Works

MOST = 0.02


def error(machine: Machine, task: Task, engine: Any) -> tuple[float, float, float, int]:
    """Energy that is unaccounted for, error of the work of forces from outside, work done by
    anything, J; how many connections broke."""
    value, real = constants(), module.mujoco
    trial = Trial(machine, task, engine, value["step_rate"], True, 0.2, 1e9, value, DEFAULT)
    world = trial._world
    trial._settle()
    trial._start()
    start, first = world.snapshot(), len(world.works()) - 1
    found = Works()
    module.mujoco = found  # type: ignore[assignment]
    try:
        status = trial._window()
    finally:
        module.mujoco = real
    if status != "ok":
        return 0.0, 0.0, 0.0, 0
    works = world.works()[first:]
    joints = world._works_of_joints[0][first:].sum()
    gained = (world.energies(world.snapshot()) - world.energies(start)).sum()
    told = (works[-1] - works[0]).sum() - joints
    left, wrong = float(gained - found.inside - told), float(told - found.outside)
    return left, wrong, found.turnover, len(trial._broken)


def main() -> None:
    """Print the errors."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--machines", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    engine = choose_engine(MUJOCO).start()
    tasks = [get_task(name, engine=MUJOCO) for name in task_names()]
    errors: list[tuple[float, float, str]] = []
    number = 0
    while len(errors) < options.machines:
        task = tasks[number % len(tasks)]
        machine = random_machine(Random(f"balance {options.seed}/{number}"), task.brief)
        number += 1
        if any(entry == "loads" for _, entry, _ in task.switches(machine)):
            continue  # objects that become heavier gain energy from nothing
        left, wrong, done, broken = error(machine, task.trials(0)[0], engine)
        if broken and done > 1.0:
            text = f"{number - 1} {task.name}: {left:.1f} J, outside {wrong:.1f}, of {done:.0f} J"
            errors.append((abs(left) / done, abs(wrong) / done, text))
    errors.sort(reverse=True)
    shares = np.array([each[:2] for each in errors])
    print(f"{len(errors)} machines that break, of {number}")
    for name, share in (("median", 0.5), ("95 %", 0.95), ("greatest", 1.0)):
        whole, outside = 100 * np.quantile(shares, share, axis=0)
        print(f"{name:10s}{whole:8.3f} %, of forces from outside {outside:8.3f} %")
    print(*(f"{100 * share:.2f} %  {name}" for share, _, name in errors[:8]), sep="\n")
    sys.exit(bool(shares.max() > MOST))


if __name__ == "__main__":
    main()
