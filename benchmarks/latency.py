"""Compares the duration of a run with its critical path of dependent calls and simulations.

    python benchmarks/latency.py [--task throwing] [--seed 0] [--latency 1] [--workers 2]

Performs a full hierarchical run with default settings, real physics, and replies that take
`latency` seconds. The critical path of a trajectory is the sum of its successive calls and of the
longest simulation after each wave of calls, not counting time spent waiting for a worker. Plans and
structures are barriers, because the beam is refilled before each.
"""

from __future__ import annotations

import argparse
import asyncio
import re
import time
from collections import defaultdict
from typing import Any

from agentflow.agents.base import AskContext
from agentflow.agents.registry import scripts
from agentflow.app.design.evaluator import PhysicsEvaluator
from agentflow.env.pool.pool import RolloutPool
from agentflow.env.tasks.registry import get_task
from agentflow.llm.messages import Reply, Request
from agentflow.llm.procedural import ProceduralClient
from agentflow.prompts.render import PromptSet
from agentflow.workflows.registry import WORKFLOWS
from agentflow.workflows.settings import WorkflowSettings


class SlowClient(ProceduralClient):
    """The procedural model with a delay."""

    def __init__(self, seed: int, latency: float) -> None:
        super().__init__(seed, scripts())
        self._latency = latency
        self.spans: list[tuple[str, float, float]] = []

    async def complete(self, request: Request) -> Reply:
        """Wait, then answer."""
        start = time.perf_counter()
        await asyncio.sleep(self._latency)
        reply = await super().complete(request)
        self.spans.append((request.label, start, time.perf_counter()))
        return reply


class TimedEvaluator(PhysicsEvaluator):
    """An evaluator that knows the duration of each simulation."""

    @property
    def seconds(self) -> dict[str, float]:
        """Duration of each simulation by machine digest."""
        return {digest: rollout.wall_seconds for digest, rollout in self.rollouts.items()}


class EvaluationLog:
    """Records the machine of each evaluation by label."""

    def __init__(self) -> None:
        self.machines: dict[str, str] = {}

    def event(self, kind: str, label: str, **data: Any) -> None:
        """Record an evaluation."""
        if kind == "evaluation":
            self.machines[label] = data["machine"]

    def save_machine(self, digest: str, text: str) -> None:
        """Ignored."""


def critical_path(
    spans: list[tuple[str, float, float]], machines: dict[str, str], seconds: dict[str, float]
) -> float:
    """Seconds of the longest chain of calls and simulations."""
    barriers: dict[str, float] = defaultdict(float)
    waves: dict[str, dict[str, float]] = defaultdict(dict)
    for label, start, end in spans:
        place = re.search(r"traj-\d+", label)
        wave = re.sub(r"try-\d+", "", label) + (f"{start:.1f}" if "try-" in label else "")
        stage = re.match(r"meta_designer|designer/structure-\d+", label)
        key = f"{stage[0]}/{place[0] if place else ''}" if stage else f"/{place and place[0]}"
        waves[key][wave] = max(waves[key].get(wave, 0.0), end - start)
    rounds: dict[tuple[str, str], float] = defaultdict(float)
    for label, digest in machines.items():
        place, around = re.search(r"traj-\d+", label), re.sub(r"/node-\d+", "", label)
        if place:
            best = max(rounds[place[0], around], seconds.get(digest, 0.0))
            rounds[place[0], around] = best
    for key, chain in waves.items():
        stage, _, place_name = key.rpartition("/")
        own = sum(value for (at, _), value in rounds.items() if at == place_name)
        total = sum(chain.values()) + (0.0 if stage else own)
        barriers[stage] = max(barriers[stage], total)
    return sum(barriers.values())


async def measure(options: argparse.Namespace) -> None:
    """Run once and print both durations."""
    task, log = get_task(options.task), EvaluationLog()
    client = SlowClient(options.seed, options.latency)
    context = AskContext(client, PromptSet())
    async with RolloutPool(options.workers) as pool:
        evaluator = TimedEvaluator(task, pool, options.seed)
        start = time.perf_counter()
        result = await WORKFLOWS["hierarchical"](
            task.brief, lambda _: context, evaluator, WorkflowSettings(), log, options.seed
        )
        wall = time.perf_counter() - start
    path = critical_path(client.spans, log.machines, evaluator.seconds)
    physics = sum(evaluator.seconds.values())
    score = result.best.score if result.best else None
    print(f"score {score}; {len(client.spans)} calls, {len(evaluator.rollouts)} rollouts")
    print(f"physics alone {physics:.1f} s, on {options.workers} workers")
    floor = max(path, physics / options.workers)
    print(f"wall {wall:.1f} s, critical path {path:.1f} s, ratio {wall / path:.2f}")
    print(f"lower bound (critical path, or all physics divided by workers) {floor:.1f} s")
    print(f"ratio to the lower bound {wall / floor:.2f}")


def main() -> None:
    """Read the options and measure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--task", default="throwing")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--latency", type=float, default=1.0)
    parser.add_argument("--workers", type=int, default=2)
    asyncio.run(measure(parser.parse_args()))


if __name__ == "__main__":
    main()
