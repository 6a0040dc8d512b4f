"""A rollout: check a machine, run the trials of a task with it, combine their results."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace
from time import thread_time

from agentflow.env.constants import Constants, constants
from agentflow.env.physics.engine import Engine, TooLargeError
from agentflow.env.physics.engines import choose_engine
from agentflow.env.rollout import Rollout, invalid_rollout
from agentflow.env.simulation.requirements import apply, displaced, judge
from agentflow.env.simulation.trial import Trial
from agentflow.env.simulation.trials import combine_trials
from agentflow.env.simulation.variations import DEFAULT, Variation, VariedEngine
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.family import TrialFamily
from agentflow.errors import UsageError
from agentflow.machine.problems import LATER_RULES
from agentflow.machine.requirements import Requirement
from agentflow.machine.tree import Machine
from agentflow.machine.validity import problems_of

RATES = (30, 1000)
"""Hz: below them contacts and load windows are not resolved, above them rollouts take too long."""
_local = threading.local()


def simulate(
    machine: Machine,
    task: Task,
    *,
    seed: int = 0,
    rate: float | None = None,
    power: bool = True,
    interval: float | None = None,
    cpu_limit: float = 60.0,
    engine: Engine | None = None,
    physics: Constants | None = None,
    recorded: bool = False,
    variation: Variation = DEFAULT,
) -> Rollout:
    """Run all trials of a task with a machine. Never raises because of what the machine does.

    Args:
        machine: File-valid. If it is otherwise invalid, it is not simulated.
        task: The level; it names the engine.
        seed: Seed of the task's random trials. Scenes have their own seeds, so a task without
            trials gives the same rollout for every seed.
        rate: Steps per second; the constants' rate by default.
        power: Off as a control experiment: the schedule never starts.
        interval: Seconds between samples; the constants' by default, at least one step.
        cpu_limit: Seconds of computing after which a trial ends as `timeout`; waiting for a
            processor does not count.
        engine: A started engine in place of the task's, of which each thread keeps one.
        physics: Constants other than those of `constants.json`, for fitting; make `engine` with
            the same ones.
        recorded: The machine is from a record: rules that came later (`LATER_RULES`) do not count.
        variation: Changed conditions; its rate multiplies `rate`.

    Raises:
        UsageError: The rate is not within 30 to 1000 Hz, `interval` not above 0, or the task's
            engine not installed.
    """
    value = physics or constants()
    rate = (value["step_rate"] if rate is None else rate) * variation.rate
    interval = value["sample_interval"] if interval is None else interval
    low, high = RATES
    if not low <= rate <= high:
        raise UsageError(f"the rate is {rate:g} Hz; it must be from {low} to {high} Hz")
    if not interval > 0:
        raise UsageError(f"the interval is {interval:g} s; it must be above 0 s")
    if engine is not None and task.engine != engine.identity.name:
        task = replace(task, engine=engine.identity.name)
    later = LATER_RULES if recorded else frozenset()
    brief = task.brief
    problems = [item for item in problems_of(machine, brief) if item.code not in later]
    if problems:
        return invalid_rollout(problems)
    usual = engine or _own_engine(task.engine)

    def run(trial: Task, by: Variation, limit: float) -> Rollout:
        chosen = VariedEngine(usual, by, value["friction"]) if by.varies_bodies else usual
        return Trial(machine, trial, chosen, rate, power, interval, limit, value, by).run()

    finished: list[Rollout] = []
    trials = task.trials(seed)
    for trial in trials:
        until = thread_time() + cpu_limit
        try:
            rollout = run(trial, variation, cpu_limit)
        except TooLargeError as error:
            return invalid_rollout([error.problem], str(usual.identity))
        if brief.requirements:
            rollout = _judge(rollout, machine, trial, seed, variation, until, run)
        finished.append(rollout)
        if rollout.status == "timeout":
            break
    return combine_trials(finished, trials)


def _judge(
    rollout: Rollout,
    machine: Machine,
    task: Task,
    seed: int,
    variation: Variation,
    until: float,
    run: Callable[[Task, Variation, float], Rollout],
) -> Rollout:
    """The rollout of a trial with its requirements, which may need more simulations; those share
    its limit: `until` is a `thread_time`. Of a variation only the score is asked for, so where it
    is lost anyway, there are none."""
    brief = task.brief
    kept: dict[Requirement, list[float]] = {}
    draws = displaced(variation, brief, seed)
    if draws and variation != DEFAULT and rollout.score and brief.requirements.mode == "must":
        judged = judge(rollout, machine, brief, kept)
        if not all(item.met for item in judged.requirements if not item.requirement.within):
            draws = {}
    for item, variations in draws.items():
        for by in variations if rollout.status == "ok" and rollout.score else ():
            again = run(task, by, until - thread_time())
            if again.score is None:
                return again
            kept.setdefault(item, []).append(again.score)
    judged = rollout if rollout.score is None else judge(rollout, machine, brief, kept)
    return judged if isinstance(task, TrialFamily) else apply(judged, brief)


def _own_engine(name: str) -> Engine:
    """The engine of this name that this thread keeps between rollouts."""
    engines: dict[str, Engine] = vars(_local).setdefault("engines", {})
    spec = choose_engine(name)
    if spec.name not in engines:
        engines[spec.name] = spec.start()
    return engines[spec.name]
