"""Whatever a machine does, its rollout ends with a typed, finite result, and the next is sound."""

from __future__ import annotations

import asyncio
from functools import cache

import pytest

from agentflow.env.constants import constants
from agentflow.env.physics.engine import EngineSpec
from agentflow.env.physics.engines import default_engine
from agentflow.env.pool.pool import RolloutPool
from agentflow.env.rollout import Rollout
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.registry import get_task
from agentflow.machine.tree import Machine
from benchmarks.stress import cases, faults
from tests.env.machines import BALLASTED, CAR, machine
from tests.env.pool.test_pool import alive

SHORT = get_task("movement", {"window": 1, "blocks.max": 0})


def heap(count: int) -> Machine:
    """Rows of wooden cubes on both sides of the root and of each other, 145 blocks at most."""
    rows: list[tuple[int, ...]] = [(0, -1, -1)]
    for side in (2, 3):
        rows.append((15, 0, side))
        rows += [(15, len(rows) - 1 + i, 0) for i in range(7)]
    for beam in range(1, len(rows)):
        for face in (3, 4):
            rows.append((15, beam, face))
            rows += [(15, len(rows) - 1 + i, 0) for i in range(3)]
    return machine(*rows[:count])


@cache
def short() -> Rollout:
    """The drive that every other rollout must leave as it is."""
    return simulate(CAR, SHORT)


def test_light_blocks_on_suspensions_do_not_explode() -> None:
    tree = machine((0, -1, -1), (16, 0, 1), (41, 1, 4), (2, 1, 1), (35, 2, 0))
    assert simulate(tree, get_task("movement/2")).status == "ok"


@pytest.mark.slow
def test_a_machine_of_120_blocks_is_simulated() -> None:
    rollout = simulate(heap(120), SHORT)
    assert rollout.status == "ok"
    assert faults(rollout) == []


@pytest.mark.slow
@pytest.mark.pybullet
def test_a_piece_may_have_127_links_and_not_one_more() -> None:
    assert simulate(heap(128), SHORT).status == "ok"
    rollout = simulate(heap(129), SHORT)
    assert [problem["message"] for problem in rollout.problems] == [
        "the machine has 129 parts in one piece; pybullet holds at most 128: "
        "remove blocks (a two-ended block has 2 parts, a moving joint in a loop counts as one more)"
    ]


@pytest.mark.slow
def test_a_machine_that_falls_into_a_heap_of_blocks_ends() -> None:
    """Every connection breaks under its own weight: 60 loose blocks in one place."""
    brittle = constants().changed({"strength_force": 1.0, "strength_torque": 1.0})
    engine = default_engine().start(brittle)
    rollout = simulate(heap(60), SHORT, engine=engine, physics=brittle)
    assert rollout.status == "ok"
    assert len(rollout.broken) == 59
    assert faults(rollout) == []
    cut = simulate(heap(60), SHORT, engine=engine, physics=brittle, cpu_limit=0.2)
    assert (cut.status, cut.score, cut.trace) == ("timeout", None, None)
    assert simulate(BALLASTED, SHORT, engine=engine).status == "invalid"
    assert simulate(CAR, SHORT, engine=engine).digest == short().digest
    engine.close()


@pytest.mark.slow
async def test_a_rollout_over_its_wall_time_limit_leaves_the_others_alone() -> None:
    async with RolloutPool(2) as pool:
        pids = pool.pids
        await pool.run(CAR, SHORT)
        cut, *others = await asyncio.gather(
            pool.run(CAR, get_task("movement", {"window": 60}), cpu_limit=0.05),
            *(pool.run(CAR, SHORT) for _ in range(3)),
        )
        assert (cut.status, cut.score) == ("timeout", None)
        assert cut.feedback.text == "The simulation was cut off after 0.05 s of computing time."
        assert {rollout.digest for rollout in others} == {short().digest}
        assert pool.pids == pids
    assert alive(pids) == []


@pytest.mark.slow
@pytest.mark.timeout(900)
async def test_random_machines_give_sound_results_at_every_task(engine_spec: EngineSpec) -> None:
    """`benchmarks/stress.py` tries two thousand."""
    async with RolloutPool(2) as pool:

        async def found(case: tuple[str, Task, Machine]) -> list[str]:
            name, task, tree = case
            return [f"{name}: {fault}" for fault in faults(await pool.run(tree, task))]

        results = await asyncio.gather(*map(found, cases(60, 1, engine_spec.name)))
    assert [fault for result in results for fault in result] == []
