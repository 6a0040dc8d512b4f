"""Times a 20-block car against a bare step loop of the same bodies (spec 2.5).

Run: `python benchmarks/physics.py [--repeats N]`. One table on standard output; medians.
"""

from __future__ import annotations

import argparse
import multiprocessing
import resource
import statistics
import time
from collections.abc import Callable

from agentflow.env.constants import constants
from agentflow.env.engines.assembly import assemble
from agentflow.env.engines.bullet import pybullet
from agentflow.env.engines.pybullet import PyBulletEngine
from agentflow.env.rollout import simulate
from agentflow.env.tasks.registry import get_task
from agentflow.machine.geometry import place
from agentflow.machine.tree import Machine, Step
from agentflow.machine.validity import check

ROWS = (
    *((0, -1, -1), (1, 0, 0), (1, 0, 1), (2, 1, 1), (2, 1, 3), (2, 2, 1), (2, 2, 3)),
    *((63, 0, 4), (1, 7, 0), (15, 8, 0), (15, 7, 7), (15, 7, 8), (15, 7, 9)),
    *((15, 7, 10), (15, 7, 11), (15, 7, 12), (1, 7, 3), (1, 7, 6), (35, 16, 0), (35, 17, 0)),
)
"""Four powered wheels under a tower: (type, parent, face)."""
CAR = Machine(tuple(Step(i, *row) for i, row in enumerate(ROWS)))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=15)
    repeats = parser.parse_args().repeats
    task = get_task("movement")
    report = check(CAR, task.brief)
    assert report.machine_valid, report.problems
    brief = {"blocks": tuple(sorted({step.type for step in CAR}))}
    first = simulate(CAR, task)
    assert first.status == "ok", first.problems
    assert first.sim_seconds is not None
    steps = round((first.sim_seconds + constants()["settle_least"]) * constants()["step_rate"])
    whole, bare = [], []
    for _ in range(repeats):
        whole.append(seconds(lambda: simulate(CAR, task)))
        bare.append(bare_loop(steps))
    middle, floor = statistics.median(whole), statistics.median(bare)
    print(f"blocks                      {len(CAR)}, types {brief['blocks']}")
    print(f"steps                       {steps}")
    print(f"bare stepSimulation loop    {1000 * floor:8.1f} ms")
    print(f"whole rollout               {1000 * middle:8.1f} ms   {middle / floor:.2f} x bare")
    print(f"rollouts per second         {1 / middle:8.1f}")
    print(f"two processes               {parallel(repeats, middle):8.2f} x one")
    print(f"memory of this process      {peak():8.1f} MB")


def seconds(work: Callable[[], object]) -> float:
    """Wall-clock seconds of one call."""
    began = time.perf_counter()
    work()
    return time.perf_counter() - began


def bare_loop(steps: int) -> float:
    """Seconds for the steps alone: same bodies, shapes, flags, motors."""
    engine = PyBulletEngine()
    task = get_task("movement")
    rate = constants()["step_rate"]
    engine.build(assemble(CAR, place(CAR), constants()), task.scene(), rate)
    settle = round(constants()["settle_least"] * rate)

    def loop() -> None:
        for step in range(steps):
            if step == settle:
                engine.switch("motors", on=True)
            pybullet.stepSimulation(engine.client)

    taken = seconds(loop)
    engine.close()
    return taken


def parallel(repeats: int, alone: float) -> float:
    """How many times one process's throughput two processes reach."""
    context = multiprocessing.get_context("spawn")
    with context.Pool(2) as pool:
        pool.map(rollouts, [1, 1], chunksize=1)
        taken = max(pool.map(rollouts, [repeats, repeats], chunksize=1))
    return 2 * repeats * alone / taken


def rollouts(count: int) -> float:
    """Seconds for some rollouts in this process."""
    task = get_task("movement")
    return seconds(lambda: [simulate(CAR, task) for _ in range(count)])


def peak() -> float:
    """Greatest memory of this process so far, MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


if __name__ == "__main__":
    main()
