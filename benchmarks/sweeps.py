"""Measures the overhead of a sweep per event, and the time to make tables from its runs.

Machines are random, no model is called, and every rollout is a copy of one simulated beforehand, so
only bookkeeping remains: run directories, events, machines, the store, the log.
"""

from __future__ import annotations

import argparse
import asyncio
import tempfile
import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import yaml

from agentflow.app.design.execution import execute
from agentflow.app.design.plan import RunPlan
from agentflow.app.design.replay import MemoryRecord
from agentflow.app.sweeps.plan import plan_sweep, sweep_folder
from agentflow.app.sweeps.run import run_sweep_async
from agentflow.app.sweeps.views import view
from agentflow.env.rollout import Rollout
from agentflow.env.simulation.simulate import simulate
from agentflow.env.simulation.variations import DEFAULT, Variation
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.registry import get_task
from agentflow.llm.wrappers.record import CallLog
from agentflow.machine.formats.detect import read_any
from agentflow.machine.tree import Machine
from agentflow.models.choices import open_models
from agentflow.runs import Event

THROWER = Path(__file__).parent.parent / "tests/machines/thrower_long_arm.json"
SWEEP = {
    "title": "Benchmark",
    "base": {
        "task": "throwing",
        "workflow": "random-dsl",
        "settings": {"trajectories": 4, "max_simulations": 24},
    },
    "axes": {"condition": {"one": {"history": True}, "other": {"history": False}}},
    "table": {"stage": "env_feedback", "metrics": ["valid", "mean", "max"]},
}


class StandIn:
    """A simulator that always returns the same throw."""

    def __init__(self) -> None:
        machine = read_any(THROWER.read_text(encoding="utf-8")).machine
        assert machine is not None
        self._rollout = simulate(machine, get_task("throwing"))

    async def run(
        self,
        machine: Machine,  # noqa: ARG002
        task: Task,  # noqa: ARG002
        *,
        seed: int = 0,  # noqa: ARG002
        variation: Variation = DEFAULT,  # noqa: ARG002
    ) -> Rollout:
        return self._rollout


class Silent:
    """Counts events and shows nothing."""

    def __init__(self) -> None:
        self.events = 0

    def run_started(self, run: str) -> None: ...

    def event(self, run: str, event: Event) -> None:  # noqa: ARG002
        self.events += 1

    def remark(self, run: str, line: str) -> None: ...

    def run_finished(self, run: str, result: Mapping[str, Any]) -> None: ...

    def run_failed(self, run: str, reason: str) -> None:
        raise RuntimeError(f"{run}: {reason}")


async def in_memory(plans: list[RunPlan], pool: StandIn, call_log: CallLog) -> float:
    """CPU seconds of the same runs without recording to disk."""
    began = time.process_time()
    for plan in plans:
        models = open_models(plan.config, call_log, print)
        await execute(plan, models, MemoryRecord(), pool)
    return time.process_time() - began


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=1000)
    runs = parser.parse_args().runs
    pool, watcher = StandIn(), Silent()
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        path = folder / "benchmark.yaml"
        path.write_text(yaml.safe_dump(SWEEP))
        plan = plan_sweep(path, (), {}, seeds=runs // 2)
        every = [replace(plan.plan_of(one), config=one.config) for one in plan.runs]
        with CallLog(folder / "calls.jsonl", print) as call_log:
            bare = asyncio.run(in_memory(every, pool, call_log))
        where = sweep_folder(plan, path, folder / "out")
        began, wall = time.process_time(), time.perf_counter()
        asyncio.run(run_sweep_async(plan, where, watcher, jobs=2, resume=False, pool=pool))
        whole, wall = time.process_time() - began, time.perf_counter() - wall
        print(f"{len(plan.runs)} runs, {watcher.events} events, {wall:.1f} s wall")
        print(f"CPU time without recording: {bare:.1f} s; as a sweep: {whole:.1f} s")
        print(f"bookkeeping: {1000 * (whole - bare) / watcher.events:.2f} ms per event (limit 2)")
        for name in ("published", "scores", "expansions", "usage"):
            began, wall = time.process_time(), time.perf_counter()
            view(where, name)
            spent, wall = time.process_time() - began, time.perf_counter() - wall
            print(f"table {name}: {spent:.2f} s CPU, {wall:.2f} s wall (limit 5)")


if __name__ == "__main__":
    main()
