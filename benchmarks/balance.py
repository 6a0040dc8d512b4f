"""Whether the energy that feedback tells of adds up, on random machines that break.

    python benchmarks/balance.py [--machines 200] [--seed 0]

On MuJoCo, the work of all constraints, dampers and suspensions is integrated here in every step.
With the work that `World.works` tells, what the engine's steps add by themselves, and what blocks
and objects gain in kinetic energy and in height, it must give 0. The error is the sum over the work
done by or against anything. What the steps add follows from inertia alone (`Works.steps`), and has
a column and a limit of its own; feedback counts it in what is lost.
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

MOST = np.array([0.02, 0.02, 0.05])
"""Greatest share of the error, of that of the work of forces from outside, and of what the engine's
steps add."""


def error(machine: Machine, task: Task, engine: Any) -> tuple[tuple[float, ...], float, int]:
    """Energy that is unaccounted for, error of the work of forces from outside, what the engine's
    steps add; work done by anything, J; how many connections broke."""
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
        return (), 0.0, 0
    works = world.works()[first:]
    joints = world._works_of_joints[0][first:].sum()
    gained = (world.energies(world.snapshot()) - world.energies(start)).sum()
    told = (works[-1] - works[0]).sum() - joints
    left, wrong = float(gained - found.inside - told - found.steps), float(told - found.outside)
    return (left, wrong, found.steps), found.turnover, len(trial._broken)


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
    errors: list[tuple[list[float], str]] = []
    number = 0
    while len(errors) < options.machines:
        task = tasks[number % len(tasks)]
        machine = random_machine(Random(f"balance {options.seed}/{number}"), task.brief)
        number += 1
        if any(entry == "loads" for _, entry, _ in task.switches(machine)):
            continue  # objects that become heavier gain energy from nothing
        own, done, broken = error(machine, task.trials(0)[0], engine)
        if broken and done > 1.0:
            left, wrong, steps = own
            text = f"{left:.2f} J, outside {wrong:.2f}, steps {steps:.2f}, of {done:.0f} J"
            shares = [abs(each) / done for each in own]
            errors.append((shares, f"{number - 1} {task.name}: {text}"))
    found = np.array([shares for shares, _ in errors])
    print(f"{len(errors)} machines that break, of {number}")
    for name, share in (("median", 0.5), ("95 %", 0.95), ("greatest", 1.0)):
        whole, outside, steps = 100 * np.quantile(found, share, axis=0)
        print(f"{name:10s}{whole:8.3f} %, of forces from outside {outside:8.3f} %, ", end="")
        print(f"added by the engine's steps {steps:8.3f} %")
    for shares, text in sorted(errors, key=lambda each: -max(each[0]))[:8]:
        print(f"{100 * max(shares):.2f} %  {text}")
    sys.exit(bool((found.max(axis=0) > MOST).any()))


if __name__ == "__main__":
    main()
