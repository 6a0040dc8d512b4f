"""Rollouts per second of CPU time on each engine, and what one machine in many worlds costs."""

from __future__ import annotations

import asyncio
import json
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from statistics import median

from cars import CAR
from figures import (
    MUJOCO,
    PYBULLET,
    Figure,
    Options,
    cost_of,
    engines,
    level_of,
    run,
    shipped,
    timed,
)

from agentflow.env.physics.mujoco.engine import PATIENCE
from agentflow.env.pool.pool import RolloutPool
from agentflow.env.simulation.simulate import simulate
from agentflow.env.simulation.variations import (
    DEFAULT,
    Variation,
    perturbations_of,
    variations_of,
)
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.registry import get_task
from agentflow.machine.tree import Control, Machine

BUSY, LINES = 0.9, 3000.0
"""Share of the time in which workers simulate; lines of `check` a second."""
MOST = 0.7
"""Of the cost of as many separate rollouts."""
SPREAD = 2
"""Workers over which a pool spreads them."""
CAR_LEAST, CAR_RATIO, THROW_RATIO, NEXT = 24.0, 2.2, 1.8, 45.0


def speed(options: Options) -> Iterator[Figure]:
    """Whole rollouts, on the engines in turns; the fastest of each."""
    rates = {name: _rates(machine, options.repeats) for name, machine in _machines().items()}
    for name, found in rates.items():
        mujoco, ratio = found[MUJOCO], found[MUJOCO] / found[PYBULLET]
        least = CAR_RATIO if name == "car of 20 blocks" else THROW_RATIO
        told = f"{mujoco:.1f} /s, {ratio:.2f} x PyBullet's {found[PYBULLET]:.1f} /s"
        if name == "car of 20 blocks":
            met = mujoco >= CAR_LEAST and ratio >= least
            yield Figure(f"{name}, whole rollout", told, f"{CAR_LEAST:g} /s, {least} x", met)
            yield Figure(f"{name}, second step", f"{mujoco:.1f} /s", f"{NEXT:g} /s", mujoco >= NEXT)
        else:
            yield Figure(f"{name}, whole rollout", told, f"{least} x", ratio >= least)


def _machines() -> dict[str, Machine]:
    return {
        "car of 20 blocks": CAR,
        "published throw": shipped("published_throw"),
        "throw with springs": shipped("throwing/spring_arm"),
    }


def _rates(machine: Machine, repeats: int) -> dict[str, float]:
    started = engines()
    least = dict.fromkeys(started, float("inf"))
    for _ in range(repeats):
        for name, engine in started.items():
            began = time.process_time()
            run(machine, engine)
            least[name] = min(least[name], time.process_time() - began)
    for engine in started.values():
        engine.close()
    return {name: 1.0 / seconds for name, seconds in least.items()}


def worlds(options: Options) -> Iterator[Figure]:
    """Rollouts of one machine on MuJoCo: each as of what never was simulated before and one after
    the other, in turns; then spread over workers. PyBullet keeps nothing of a machine."""
    engine = engines()[MUJOCO]
    engine.patience = 0  # type: ignore[attr-defined]
    for what, jobs in _many().items():
        least = [float("inf")] * 2
        for again in (False, True) * max(1, options.repeats // 2):
            seconds = 0.0
            for machine, task, variation in jobs:
                one = partial(simulate, machine, task, engine=engine, variation=variation)
                seconds += timed(engine, one, apart=not again)
            least[again] = min(least[again], seconds)
        apart, together = (1e3 * seconds / len(jobs) for seconds in least)
        told = f"{together:.1f} ms each, {together / apart:.2f} x the {apart:.1f} ms apart"
        yield Figure(what, told)
        wall = asyncio.run(_spread(jobs, options.repeats))
        told = f"{1e3 * wall / len(jobs):.1f} ms of wall time each, {wall / least[0]:.2f} x"
        met = wall <= MOST * least[0]
        yield Figure(f"{what}, spread over {SPREAD} workers", told, f"{MOST} x", met)
    engine.close()


async def _spread(jobs: Sequence[tuple[Machine, Task, Variation]], repeats: int) -> float:
    """Least wall time of all rollouts at once in workers that have done enough, s."""
    least, before = float("inf"), 1 + SPREAD * PATIENCE // len(jobs)
    async with RolloutPool(SPREAD) as pool:
        for _ in range(before + repeats):
            began = time.perf_counter()
            await asyncio.gather(*(pool.run(m, task, variation=v) for m, task, v in jobs))
            least = min(least, time.perf_counter() - began)
    return least


def _many() -> dict[str, list[tuple[Machine, Task, Variation]]]:
    found = {}
    for name, machine in _machines().items():
        task = get_task(level_of(machine), engine=MUJOCO)
        verified, robust = variations_of(machine, task), perturbations_of(machine)
        found[f"verification ({len(verified)}) of {name}"] = [(machine, task, v) for v in verified]
        found[f"robustness ({len(robust)}) of {name}"] = [(machine, task, v) for v in robust]
    machine, task = shipped("lifting/drawbridge"), get_task("lifting", engine=MUJOCO)
    found["trials (10) of a drawbridge"] = [(machine, t, DEFAULT) for t in task.trials(0)]
    machine, task = shipped("transport/steered_car"), get_task("transport", engine=MUJOCO)
    found["tuning (10) of a steered car"] = [
        (replace(machine, controls=_later(machine, 0.02 * i)), task, DEFAULT) for i in range(10)
    ]
    return found


def _later(machine: Machine, seconds: float) -> tuple[Control, ...]:
    return tuple(replace(each, lasts=each.lasts + seconds) for each in machine.controls)


def pools(options: Options) -> Iterator[Figure]:
    """What streams of the car of 20 blocks take beside the work itself: `simulate --jsonl` beside
    rollouts in one process, and lines of `check --jsonl` a second; a few lines, which take as long
    to start, are subtracted."""
    line = json.dumps(CAR.to_json()).encode() + b"\n"
    few, many = 200, 200 + options.rollouts // 2
    for name, engine in engines().items():
        command = ["simulate", "-", "--jsonl", "--task", "movement", "--engine", name]
        engine.patience = 0  # type: ignore[attr-defined]
        task, alone = get_task("movement", engine=name), []
        for _ in range(10 * options.repeats):
            began = time.process_time()
            simulate(CAR, task, engine=engine)
            alone.append(time.process_time() - began)
        first, _ = cost_of(command, [line] * few)
        last, _ = cost_of(command, [line] * many)
        own, each = median(alone), (last - first) / (many - few)
        told = f"{100 * own / each:.0f} %: {1e3 * own:.1f} of {1e3 * each:.1f} ms a rollout"
        yield Figure(f"simulate --jsonl, {name}", told, f"{100 * BUSY:.0f} %", own >= BUSY * each)
    command = ["check", "-", "--jsonl"]
    first, last = (cost_of(command, [line] * count)[0] for count in (1_000, 11_000))
    rate = 10_000 / (last - first)
    yield Figure("check --jsonl", f"{rate:,.0f} lines/s", f"{LINES:,.0f} lines/s", rate >= LINES)
