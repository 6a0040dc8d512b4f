"""Owns the rollout: judge a machine, play the trials of a task with it, make one of them.

What happens in a trial is play.py's, how trials are counted trials.py's, files are archive.py's.
"""

from __future__ import annotations

import threading

from agentflow.env.constants import Constants, constants
from agentflow.env.physics.engine import Engine, TooLargeError
from agentflow.env.physics.engines import default_engine
from agentflow.env.rollout import Rollout
from agentflow.env.simulation.play import Play
from agentflow.env.simulation.refusals import invalid, timing
from agentflow.env.simulation.trials import joined
from agentflow.env.tasks.base import Task
from agentflow.machine.problems import Problem
from agentflow.machine.tree import Machine
from agentflow.machine.validity import check

_local = threading.local()


def simulate(
    machine: Machine,
    task: Task,
    *,
    seed: int = 0,
    rate: float | None = None,
    power: bool = True,
    interval: float | None = None,
    wall_limit: float = 60.0,
    engine: Engine | None = None,
    physics: Constants | None = None,
) -> Rollout:
    """Try a machine at a task (spec 2.5), all trials of it. Never raises for what a machine does.

    Args:
        machine: File-valid; everything else is judged here first, and an invalid machine is not
            simulated.
        task: The level to play.
        seed: Of a task's random trials. Scenes have their own seeds, so a task without trials
            gives the same rollout for every seed.
        rate: Steps per second; the constants' rate by default.
        power: Off is the control experiment: the schedule never starts.
        interval: Seconds between samples; the constants' by default, at least one step.
        wall_limit: Wall-clock seconds after which a trial ends as `timeout`.
        engine: Where to run it; by default one that this thread keeps.
        physics: Other constants than those of `constants.json`, for fitting; give them to an
            engine of your own as well.

    Raises:
        UsageError: `rate` is not within 30 to 1000 Hz, or `interval` not above 0.
    """
    value = physics or constants()
    rate, interval = timing(rate, interval, value)
    report = check(machine, task.brief)
    if not report.task_valid:
        return invalid(report.problems)
    chosen = engine or _own_engine()
    played: list[Rollout] = []
    for trial in task.trials(seed):
        try:
            play = Play(machine, trial, chosen, rate, power, interval, wall_limit, value)
        except TooLargeError as error:
            return invalid([Problem("too_many_parts", (), str(error))], str(chosen.identity))
        played.append(play.to_the_end())
        if played[-1].status == "timeout":
            break
    return joined(played)


def _own_engine() -> Engine:
    """The engine that this thread keeps between rollouts."""
    if not hasattr(_local, "engine"):
        _local.engine = default_engine().start()
    engine: Engine = _local.engine
    return engine
