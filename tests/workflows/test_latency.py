"""How long a run waits: measured in a clock that jumps to the next thing that happens."""

from __future__ import annotations

import asyncio
import re
from collections import defaultdict
from collections.abc import Callable

import pytest

from agentflow.llm.messages import Reply, Request
from agentflow.machine.tree import Machine
from agentflow.search.node import Evaluation
from agentflow.search.registry import STRATEGIES
from agentflow.search.strategies import deals_budget
from tests.timing import JumpingLoop
from tests.workflows.fakes import Author, Run, Shelf

LATENCY, ROLLOUT, WORKERS = 1.0, 0.15, 2
"""Seconds per reply, seconds per simulation, simulations at a time."""


class Slow:
    """A client that takes a second for every reply, as many at a time as are asked."""

    name = "slow"

    def __init__(self, answer: Callable[[Request], Reply]) -> None:
        self.answer = answer
        self.starts: list[tuple[str, float]] = []

    async def complete(self, request: Request) -> Reply:
        self.starts.append((request.label, asyncio.get_running_loop().time()))
        await asyncio.sleep(LATENCY)
        return self.answer(request)

    async def aclose(self) -> None: ...


class SlowShelf(Shelf):
    """An evaluator of two workers."""

    def __init__(self) -> None:
        super().__init__()
        self.workers = asyncio.Semaphore(WORKERS)

    async def evaluate(self, found: Machine, label: str) -> Evaluation:
        async with self.workers:
            await asyncio.sleep(ROLLOUT)
            return await super().evaluate(found, label)


def critical_path(starts: list[tuple[str, float]]) -> float:
    """Seconds of the longest chain of calls that need each other; simulations not counted.

    Plans and structures are barriers (the beam is refilled between them); after that every
    trajectory depends on itself alone. Calls of one trajectory at one moment are one wave.
    """
    chains: dict[str, dict[str, set[float]]] = defaultdict(lambda: defaultdict(set))
    for label, start in starts:
        stage = re.match(r"meta_designer|designer/structure-\d+", label)
        place = re.search(r"traj-\d+", label)
        chains[stage[0] if stage else "rest"][place[0] if place else ""].add(round(start, 6))
    return LATENCY * sum(max(map(len, stage.values())) for stage in chains.values())


@pytest.mark.slow
@pytest.mark.parametrize("refused", [0.0, 0.3])
@pytest.mark.parametrize("strategy", [name for name in STRATEGIES if not deals_budget(name)])
def test_a_run_takes_little_longer_than_its_critical_path(refused: float, strategy: str) -> None:
    """Eight trajectories, five rounds, all switches on; a second per reply and two workers."""
    loop = JumpingLoop()
    try:
        slow = Slow(Author(seed=4, refused=refused))
        run = Run(slow.answer, {"search": {"strategy": strategy}}, client=slow, max_retry=5)
        run.shelf = SlowShelf()
        result = loop.run_until_complete(run())
        assert len(result.stages) == 3
        assert len(run.shelf.tried) > 40
        path = critical_path(slow.starts)
        assert path > 10 * LATENCY
        assert loop.now <= 1.15 * path, (loop.now, path)
        assert loop.now >= path
    finally:
        loop.close()


@pytest.mark.slow
def test_a_trajectory_goes_on_while_the_first_machine_of_another_waits() -> None:
    """Two workers and eight first machines: the first inspector is asked after one simulation."""
    loop = JumpingLoop()
    try:
        slow = Slow(Author(seed=4, refused=0.0))
        run = Run(slow.answer, {"search": {"rounds": 0}}, client=slow)
        run.shelf = SlowShelf()
        loop.run_until_complete(run())
        asked = sorted(start for label, start in slow.starts if label.startswith("inspector/"))
        built = max(start for label, start in slow.starts if label.startswith("designer/"))
        assert asked[0] == pytest.approx(built + LATENCY + ROLLOUT)
        assert asked[-1] > asked[0]
        assert list(run.notes.of("stage")) == ["initial", "blind_refinement"]
    finally:
        loop.close()
