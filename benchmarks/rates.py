"""Rollouts per second of CPU time on each engine."""

from __future__ import annotations

import time
from collections.abc import Iterator

from cars import CAR
from figures import MUJOCO, PYBULLET, Figure, Options, engines, run, shipped

from agentflow.machine.tree import Machine

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
