"""Compares a rollout of a 20-block car with a bare loop of the same steps, and times the workers.

    python benchmarks/physics.py [--repeats N] [--flat ROLLOUTS]

Prints one table with the fastest repetition of each stage. CPU time is printed beside wall time,
because it depends less on other load. `--flat 2000` adds the memory of one worker during 2,000
short rollouts.
"""

from __future__ import annotations

import argparse
import asyncio
import multiprocessing
import os
import time
from collections.abc import Callable
from multiprocessing.synchronize import Barrier
from pathlib import Path

from cars import CAR

from agentflow.env.constants import constants
from agentflow.env.physics.assembly import assemble
from agentflow.env.physics.loads import Loads
from agentflow.env.physics.model import Assembly
from agentflow.env.physics.pybullet.engine import PyBulletEngine
from agentflow.env.physics.pybullet.library import pybullet
from agentflow.env.physics.pybullet.world import PyBulletWorld
from agentflow.env.pool.pool import RolloutPool
from agentflow.env.scene import Scene
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.registry import get_task
from agentflow.machine.geometry.placement import place

TASK = get_task("movement")
SHORT = get_task("movement", {"window": 1})
RATE = constants()["step_rate"]
SETTLE = round(constants()["settle_least"] * RATE)
TICKS = os.sysconf("SC_CLK_TCK")
Times = tuple[float, float]
"""Seconds of CPU time and of wall time."""


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--repeats", type=int, default=15)
    parser.add_argument("--flat", type=int, default=0)
    options = parser.parse_args()
    print(f"{len(CAR)} blocks; load average {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    _against_bare(options.repeats)
    asyncio.run(_workers(options.repeats))
    if options.flat:
        asyncio.run(_flat(options.flat))


# --- one process ---------------------------------------------------------------------------


def _against_bare(repeats: int) -> None:
    """Compare stages of growing work, in turns, so that other load affects all alike."""
    engine, bare = PyBulletEngine(), Bare()
    first = simulate(CAR, TASK, engine=engine)
    assert first.status == "ok", first.feedback.text
    assert first.sim_seconds is not None
    steps = round(first.sim_seconds * RATE) + SETTLE
    stages: dict[str, Callable[[], Times]] = {
        "bare stepSimulation loop": lambda: _loop(bare, steps),
        "+ drag, reading all states": lambda: _loop(engine, steps),
        "+ loads and breakage": lambda: _loop(engine, steps, loads=True),
        "whole rollout": lambda: _timed(lambda: simulate(CAR, TASK, engine=engine)),
    }
    turns = [{name: work() for name, work in stages.items()} for _ in range(repeats)]
    used, wall = (
        {name: [turn[name][side] for turn in turns] for name in stages} for side in (0, 1)
    )
    print(f"{steps} steps                            CPU ms  x bare     wall ms  x bare")
    least, floor = (min(each["bare stepSimulation loop"]) for each in (used, wall))
    for name in stages:
        a, b = min(used[name]), min(wall[name])
        print(f"{name:28s} {1e3 * a:12.1f} {a / least:8.2f} {1e3 * b:10.1f} {b / floor:8.2f}")
    whole = min(used["whole rollout"])
    print(f"rollouts per second of CPU time {1 / whole:.1f}")
    engine.close()
    bare.close()


class BareWorld(PyBulletWorld):
    """Only steps."""

    def step(self, divisions: int = 1, ahead: int = 1) -> None:  # noqa: ARG002
        pybullet.stepSimulation(self.client)


class Bare(PyBulletEngine):
    """Builds worlds that only step."""

    def build(self, assembly: Assembly, scene: Scene, rate: float) -> PyBulletWorld:
        return BareWorld(self.client, self.physics, assembly, scene, rate)


def _loop(engine: PyBulletEngine, steps: int, loads: bool = False) -> Times:
    """Time the steps without building the world; motors start after the settling time."""
    assembly = assemble(CAR, place(CAR), constants())
    world = engine.build(assembly, TASK.scene(), RATE)
    filters = Loads(assembly.joints, constants()["load_window"], 1.0 / RATE)

    def run() -> None:
        for step in range(steps):
            if step == SETTLE:
                world.switch("motors", 1.0)
            world.step()
            if loads:
                filters.update(world.reactions)

    return _timed(run)


def _timed(work: Callable[[], object]) -> Times:
    spent, began = time.process_time(), time.perf_counter()
    work()
    return time.process_time() - spent, time.perf_counter() - began


# --- workers -------------------------------------------------------------------------------


async def _workers(repeats: int) -> None:
    """Print start-up time, memory, and the speed-up by a second worker."""
    began = time.perf_counter()
    async with RolloutPool(1) as pool:
        await pool.run(CAR, SHORT)
        first = time.perf_counter() - began
        began = time.perf_counter()
        await pool.run(CAR, SHORT)
        start = first - (time.perf_counter() - began)
        spent = sum(map(_cpu_seconds, pool.pids))
    print(f"start of a worker                     {start:.2f} s, {spent:.2f} s of CPU time")
    found = {}
    for count in (1, 2):
        async with RolloutPool(count) as pool:
            await asyncio.gather(*(pool.run(CAR, SHORT) for _ in range(2 * count)))
            before = sum(map(_cpu_seconds, pool.pids))
            began = time.perf_counter()
            await asyncio.gather(*(pool.run(CAR, TASK) for _ in range(4 * repeats)))
            wall = time.perf_counter() - began
            used = sum(map(_cpu_seconds, pool.pids)) - before
            found[count] = (wall, used)
            memory = max(_memory(pid, "VmHWM") for pid in pool.pids)
    gain, share = found[1][0] / found[2][0], 2 * found[1][1] / found[2][1]
    most = _time_bare_loops(1, repeats) / _time_bare_loops(2, repeats) * 2
    print(f"two bare loops in two processes       {most:.2f} x one (the limit of this machine)")
    print(f"two workers                           {gain:.2f} x one by wall time")
    print(f"  relative to the bare loops          {gain / most:.2f}")
    print(f"  by CPU time per rollout             {share:.2f} x one")
    print(f"peak memory of a worker               {memory:.1f} MB")


def _time_bare_loops(processes: int, repeats: int) -> float:
    """Wall seconds of so many processes that each run the bare loops of 4 * `repeats` rollouts."""
    context = multiprocessing.get_context("spawn")
    begin = context.Barrier(processes + 1)
    running = [
        context.Process(target=_bare_loops, args=(begin, 4 * repeats)) for _ in range(processes)
    ]
    for process in running:
        process.start()
    begin.wait()
    began = time.perf_counter()
    for process in running:
        process.join()
    return time.perf_counter() - began


def _bare_loops(begin: Barrier, count: int) -> None:
    engine = Bare()
    _loop(engine, SETTLE)
    begin.wait()
    for _ in range(count):
        _loop(engine, SETTLE + round(TASK.window * RATE))
    engine.close()


async def _flat(rollouts: int) -> None:
    """Print the memory of one worker during many rollouts."""
    async with RolloutPool(1) as pool:
        for done in range(1, rollouts + 1):
            await pool.run(CAR, SHORT)
            if done in (10, 100) or done % max(1, rollouts // 4) == 0:
                print(f"memory after {done:5d} rollouts          {_memory(pool.pids[0]):6.1f} MB")


def _cpu_seconds(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / TICKS


def _memory(pid: int, field: str = "VmRSS") -> float:
    """A memory field of a process, MB."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return next(float(line.split()[1]) for line in lines if line.startswith(field + ":")) / 1024


if __name__ == "__main__":
    main()
