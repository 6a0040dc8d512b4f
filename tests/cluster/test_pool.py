"""Workers on the nodes of a cluster: same results as here, and no rollout lost or counted twice."""

from __future__ import annotations

import asyncio
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("ray")

from agentflow.cluster.pool import RayPool
from agentflow.env.pool.pool import RolloutPool
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.registry import get_task
from agentflow.errors import PluginError
from agentflow.rewards import Sample, Scorer
from tests.cluster.conftest import NODE, ON_CLUSTER
from tests.env.pool.test_pool import CAR, LONE_ROOT, trouble

pytestmark = ON_CLUSTER


async def test_results_are_those_of_this_process_in_the_order_of_asking() -> None:
    tasks = [get_task("movement", {"window": 1 + 0.25 * (n % 4)}) for n in range(12)]
    async with RayPool(2) as pool:
        found = await asyncio.gather(*(pool.run(CAR, task) for task in tasks))
        invalid = await pool.run(LONE_ROOT, get_task("throwing"))
        with pytest.raises(RuntimeError, match=r"(?s)failed in its worker:.*Traceback.*rate"):
            await pool.run(CAR, tasks[0], variation="faster")
    here = [simulate(CAR, task) for task in tasks[:4]]
    assert [rollout.digest for rollout in found] == [rollout.digest for rollout in here] * 3
    assert [rollout.score for rollout in found] == [rollout.score for rollout in here] * 3
    assert found[0].trace is not None
    assert found[0].trace.centre.flags.writeable  # a copy of its own, as from a local worker
    assert (invalid.status, invalid.score) == ("invalid", 0.0)


def test_replies_are_rewarded_as_here() -> None:
    car = Path("examples/car.json").read_text()
    samples = [Sample("movement", text) for text in (car, "no machine", "[]", car)]
    found = []
    for open_pool in (RolloutPool, RayPool):
        with closing(Scorer(2, open_pool)) as scorer:
            found.append([(each.value, each.status) for each in scorer.rewards(samples)])
    assert found[0] == found[1]
    assert [status for _, status in found[0]] == ["ok", "invalid", "invalid", "ok"]


async def test_a_worker_that_dies_harms_no_rollout(tmp_path: Path) -> None:
    task = get_task("movement", {"window": 1})
    async with RayPool(2) as pool:
        dying = pool.run(CAR, trouble(tmp_path, 1, "die"))
        found = await asyncio.gather(dying, *(pool.run(CAR, task) for _ in range(8)))
    assert len(list(tmp_path.iterdir())) == 1
    assert {(rollout.status, rollout.digest) for rollout in found} == {
        ("ok", simulate(CAR, task).digest)
    }


async def test_three_deaths_are_a_crash_and_no_answer_is_a_timeout(tmp_path: Path) -> None:
    deaths, naps = tmp_path / "deaths", tmp_path / "naps"
    deaths.mkdir()
    naps.mkdir()
    async with RayPool(1, grace=10) as pool:
        crashed = await pool.run(CAR, trouble(deaths, 9, "die"))
        hung = await pool.run(CAR, trouble(naps, 1, "sleep"), cpu_limit=0.5)
        with pytest.raises(PluginError, match="scene raised ValueError: no such scene"):
            await pool.run(CAR, trouble(tmp_path, 9, "raise"))
        after = await pool.run(CAR, get_task("movement", {"window": 1}))
    assert (crashed.status, crashed.score) == ("crashed", None)
    assert crashed.feedback.text == (
        "No score: the simulation was cut off, its process died 3 times."
    )
    assert len(list(deaths.iterdir())) == 3
    assert (hung.status, hung.score) == ("timeout", None)
    assert hung.feedback.text == "No score: the simulation was cut off, no answer within 10.5 s."
    assert after.status == "ok"


async def test_a_node_that_is_removed_harms_no_rollout(cluster: Any) -> None:
    task = get_task("movement", {"window": 1})
    finished = []

    async with RayPool(2) as pool:

        async def run() -> None:
            finished.append(await pool.run(CAR, task))
            if len(finished) == 6:
                (node,) = cluster.worker_nodes
                cluster.remove_node(node, allow_graceful=False)

        await asyncio.gather(*(run() for _ in range(30)))
    cluster.add_node(**NODE)
    assert {(rollout.status, rollout.digest) for rollout in finished} == {
        ("ok", simulate(CAR, task).digest)
    }
    assert len(finished) == 30
