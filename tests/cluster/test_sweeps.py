"""Runs of a sweep on two nodes: limits that they share, and a node that is lost."""

from __future__ import annotations

import asyncio
import json
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml

pytest.importorskip("ray")

from agentflow.app.design.replay import replay
from agentflow.app.sweeps.plan import plan_sweep
from agentflow.app.sweeps.run import SweepOutcome, run_sweep_async
from agentflow.runs import Event
from tests.app.sweeps.test_run import TINY, Notes
from tests.app.test_doctor import threaded
from tests.cluster.conftest import NODE, ON_CLUSTER
from tests.llm.hostile import reply

pytestmark = ON_CLUSTER
LIMIT = 3
RUNS = ("seed-0", "seed-1")


class Endpoint:
    """Answers with a machine, once it may, and counts calls that wait for an answer."""

    def __init__(self) -> None:
        self.may_answer = threading.Event()
        self.open, self.most, self.count = 0, 0, 0
        car = json.dumps(json.loads(Path("examples/car.json").read_text()))
        self._reply = reply(f"```json\n{car}\n```")

    async def __call__(self, writer: asyncio.StreamWriter) -> None:
        self.open += 1
        self.count += 1
        self.most = max(self.most, self.open)
        while not self.may_answer.is_set():
            await asyncio.sleep(0.05)
        await asyncio.sleep(0.1)
        self.open -= 1
        await self._reply(writer)


class Both(Notes):
    """Does something once both runs are at work."""

    def __init__(self, do: Callable[[], None]) -> None:
        super().__init__()
        self._do, self._seen = do, set[str]()

    def event(self, run: str, event: Event) -> None:
        super().event(run, event)
        before = len(self._seen)
        self._seen.add(run)
        if before == 1 and len(self._seen) == 2:
            self._do()

    def run_finished(self, run: str, result: object) -> None:  # noqa: ARG002
        self.said.append(("ended", run))


def sweep(folder: Path, base_url: str, watcher: Notes) -> SweepOutcome:
    """Two runs, each with four calls at once, for which each needs a node of its own."""
    base = {
        "task": "movement",
        "workflow": "single",
        "workers": 2,
        "settings": {"trajectories": 4, "search": {"rounds": 0}},
        "model": {
            "name": "m",
            "base_url": base_url,
            "endpoint": {"limits": {"concurrent": LIMIT}},
        },
    }
    path = folder / "two.yaml"
    path.write_text(yaml.safe_dump({**TINY, "base": base, "axes": {}}))
    plan = plan_sweep(path, (), {}, approve=lambda _sentence: True)
    work = run_sweep_async(plan, folder / "two", watcher, jobs=2, resume=False, on="ray")
    return asyncio.run(work)


def test_runs_on_two_nodes_share_the_limits_of_their_endpoint(tmp_path: Path) -> None:
    endpoint = Endpoint()
    watcher = Both(endpoint.may_answer.set)
    with threaded(endpoint) as server:
        outcome = sweep(tmp_path, server.base_url, watcher)
    assert (outcome.done, outcome.failed) == (RUNS, {})
    assert (endpoint.count, endpoint.most) == (8, LIMIT)
    assert [replay(outcome.path / "runs" / run, print) for run in RUNS] == [None, None]


def test_a_run_whose_node_is_lost_goes_on_elsewhere(tmp_path: Path, cluster: Any) -> None:
    def lose_node() -> None:
        (node,) = cluster.worker_nodes
        cluster.remove_node(node, allow_graceful=False)
        endpoint.may_answer.set()

    endpoint = Endpoint()
    with threaded(endpoint) as server:
        outcome = sweep(tmp_path, server.base_url, Both(lose_node))
    cluster.add_node(**NODE)
    assert (outcome.done, outcome.failed) == (RUNS, {})
    assert 8 <= endpoint.count <= 8 + LIMIT  # those under way at the lost node were made again
    assert [replay(outcome.path / "runs" / run, print) for run in RUNS] == [None, None]
