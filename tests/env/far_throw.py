"""A throw of 150 m: a real one of a machine with 40 blocks and 14 springs, stretched."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from agentflow.env.drawing.film import tracked_block
from agentflow.env.rollout import Rollout
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.registry import get_task
from agentflow.machine import Machine, library, read_machine

FILE = Path(__file__).parents[1] / "machines" / "throwing" / "two_tower_sling.json"
DISTANCE = 150.0
FREE = 10.0
"""z from which the boulder's flight is stretched: there it has left the machine, m."""


@cache
def far_throw() -> tuple[Machine, Task, Rollout]:
    """The machine, its task, and the rollout with 30 samples per second."""
    task = get_task("throwing")
    machine = read_machine(json.loads(FILE.read_text()), tuple(library())).machine
    assert machine is not None
    rollout = simulate(machine, task, interval=1 / 30, recorded=True)
    assert rollout.trace is not None
    assert rollout.score is not None
    centre = rollout.trace.centre.copy()
    z = centre[:, tracked_block(machine), 2]
    z[:] = np.where(z > FREE, FREE + (z - FREE) * (DISTANCE - FREE) / (rollout.score - FREE), z)
    return machine, task, replace(rollout, trace=replace(rollout.trace, centre=centre))
