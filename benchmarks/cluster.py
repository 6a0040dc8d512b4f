"""Compares the pool on Ray with that of worker processes, and takes a node away from a cluster.

    python benchmarks/cluster.py [--rollouts 2000] [--workers 2] [--queue 1000000]

Needs the extra `cluster`. Prints, for rollouts of a 20-block car: the time on Ray relative to that
in local processes, in four alternating parts; the rollouts per message and what messages cost; the
processor time of the driver per rollout, and how many processors one driver can keep busy; whether
all results are equal, also after one of two nodes was killed; and the memory of the driver while it
works through a long queue. Exit status 1 if a result differs.
"""

from __future__ import annotations

import argparse
import asyncio
import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from statistics import median

import ray
from cars import CAR
from ray.cluster_utils import Cluster

from agentflow.cluster.pool import MOST, RayPool
from agentflow.env.pool.pool import Pool, RolloutPool
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.registry import get_task
from agentflow.machine.tree import ROOT, Machine
from agentflow.search.concurrency import work_in_order

PARTS = 4
"""Local pool and Ray alternate this often, because other load changes."""
TASK = get_task("movement")
EMPTY = Machine((ROOT,))
THROWING = get_task("throwing")
"""A lone root is invalid there: a rollout that takes no time, and measures the queue alone."""
NODE = {"include_dashboard": False, "include_log_monitor": False, "no_monitor": True}


def main() -> None:
    """Print the numbers."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rollouts", type=int, default=2000)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--queue", type=int, default=1_000_000)
    options = parser.parse_args()
    print(
        f"{len(CAR)} blocks; load average {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors"
    )
    with nodes(options.workers, 1):
        equal = asyncio.run(_compare(options.rollouts, options.workers))
        asyncio.run(_work_through(options.queue, options.workers))
    with nodes(1, 2) as cluster:
        equal &= asyncio.run(_lose_node(options.rollouts // 10, cluster))
    sys.exit(not equal)


@contextmanager
def nodes(processors: int, count: int) -> Iterator[Cluster]:
    """A cluster of so many nodes on this machine, which RAY_ADDRESS names."""
    os.environ.update({"RAY_USAGE_STATS_ENABLED": "0", "RAY_worker_niceness": "0"})  # usually 15
    cluster = Cluster()
    try:
        for _ in range(count):
            cluster.add_node(num_cpus=processors, **NODE)
        os.environ["RAY_ADDRESS"] = cluster.address
        yield cluster
    finally:
        ray.shutdown()
        cluster.shutdown()


async def _compare(rollouts: int, workers: int) -> bool:
    """Print times of both pools; whether all results are those of this process."""
    expected = simulate(CAR, TASK).digest
    walls: dict[str, list[float]] = {"local": [], "ray": []}
    spent, found = 0.0, set()
    async with RolloutPool(workers) as local, RayPool(workers) as cluster:
        pools: dict[str, Pool] = {"local": local, "ray": cluster}
        for pool in pools.values():  # loads the engine in every worker
            await _play(pool, 4 * workers)
        for _ in range(PARTS):
            for name, pool in pools.items():
                began, used = time.perf_counter(), time.process_time()
                found |= await _play(pool, rollouts // PARTS)
                walls[name].append(time.perf_counter() - began)
                spent += (time.process_time() - used) * (name == "ray")
        pace = cluster.pace
    ratios = [ray_wall / wall for ray_wall, wall in zip(walls["ray"], walls["local"], strict=True)]
    each = spent / (PARTS * (rollouts // PARTS))
    local_sum, ray_sum = (sum(walls[name]) for name in ("local", "ray"))
    print(f"seconds, local and on Ray             {local_sum:.1f} and {ray_sum:.1f}")
    print(f"  Ray relative to local               {median(ratios):.3f} x (limit 1.10)")
    print(f"a message costs                       {pace.cost * 1e3:.2f} ms")
    print(f"a rollout takes                       {pace.work * 1e3:.1f} ms")
    print(f"rollouts in a message                 {pace.size(10**6, workers)}")
    print(f"driver's processor time per rollout   {each * 1e3:.3f} ms (limit 1 ms)")
    print(f"processors that one driver keeps busy {pace.work / each:.0f}")
    print(f"all results equal                     {found == {expected}}")
    return found == {expected}


async def _play(pool: Pool, count: int) -> set[str]:
    return {
        rollout.digest
        for rollout in await asyncio.gather(*(pool.run(CAR, TASK) for _ in range(count)))
    }


async def _lose_node(rollouts: int, cluster: Cluster) -> bool:
    """Kill one of two nodes when half of the rollouts are done; whether all results are equal."""
    found: list[str] = []
    async with RayPool(2) as pool:

        async def run() -> None:
            found.append((await pool.run(CAR, TASK)).digest)
            if len(found) == rollouts // 2:
                (node,) = cluster.worker_nodes
                cluster.remove_node(node, allow_graceful=False)

        await asyncio.gather(*(run() for _ in range(rollouts)))
    equal = found == [simulate(CAR, TASK).digest] * rollouts
    print(f"equal after one of two nodes died     {equal}, {len(found)} rollouts")
    return equal


async def _work_through(queue: int, workers: int) -> None:
    """Print the memory of this process at ten moments of a long queue."""
    async with RayPool(workers) as pool:

        async def run(_: int) -> str:
            return (await pool.run(EMPTY, THROWING)).status

        numbers, began = count(1), time.perf_counter()

        def keep(_: str) -> None:
            done = next(numbers)
            if done % max(1, queue // 10) == 0:
                spent = time.perf_counter() - began
                print(f"driver after {done:8d} rollouts        {_memory():6.1f} MB, {spent:.0f} s")

        await work_in_order(range(queue), run, keep, 4 * MOST * workers)


def _memory() -> float:
    """Resident memory of this process, MB."""
    fields = Path("/proc/self/statm").read_text().split()
    return int(fields[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


if __name__ == "__main__":
    main()
