"""The worker processes: same results as here, deaths survived, nobody left behind."""

from __future__ import annotations

import asyncio
import os
import signal
import subprocess
import sys
import time
from collections.abc import AsyncIterator, Iterable
from dataclasses import dataclass
from pathlib import Path

import pytest
import pytest_asyncio

from agentflow.env.pool.pool import RolloutPool
from agentflow.env.scene import Scene
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.families.movement import Movement
from agentflow.env.tasks.registry import get_task
from agentflow.errors import PluginError
from agentflow.machine.tree import ROOT, Machine, Step

LONE_ROOT = Machine((ROOT,))
CAR = Machine(
    (
        ROOT,
        Step(1, 1, 0, 0),
        Step(2, 1, 0, 1),
        Step(3, 2, 1, 2),
        Step(4, 2, 1, 3),
        Step(5, 2, 2, 2),
        Step(6, 2, 2, 3),
    )
)


@dataclass(frozen=True)
class Trouble(Movement):
    """Movement whose scene does harm in the process that builds it, `times` times in all."""

    folder: str = ""
    times: int = 0
    act: str = "die"

    def scene(self, machine: Machine | None = None) -> Scene:
        done = Path(self.folder)
        if len(list(done.iterdir())) < self.times:
            (done / str(os.getpid())).touch()
            if self.act == "raise":
                raise ValueError("no such scene")
            if self.act == "sleep":
                time.sleep(30)
            os.kill(os.getpid(), signal.SIGKILL)
        return super().scene(machine)


def trouble(folder: Path, times: int, act: str) -> Task:
    plain = get_task("movement", {"window": 1})
    assert isinstance(plain, Movement)
    told = {"folder": str(folder), "times": times, "act": act}
    return Trouble("movement", 1, plain.parameters, 1.0, plain.schedule, **told)


def alive(pids: Iterable[int]) -> list[int]:
    """Those of the processes that still run; one that nobody has waited for does not."""
    stats = {pid: Path(f"/proc/{pid}/stat") for pid in pids}
    return [pid for pid, stat in stats.items() if stat.exists() and ") Z " not in stat.read_text()]


@pytest_asyncio.fixture
async def pool() -> AsyncIterator[RolloutPool]:
    async with RolloutPool(1) as started:
        yield started


@pytest.mark.slow
async def test_results_are_those_of_this_process_in_the_order_of_asking() -> None:
    tasks = [get_task("movement", {"window": window}) for window in (1, 1.25, 1.5)]
    async with RolloutPool(2) as pool:
        found = await asyncio.gather(*(pool.run(CAR, task) for task in tasks))
        invalid = await pool.run(LONE_ROOT, get_task("throwing"))
    here = [simulate(CAR, task) for task in tasks]
    assert [rollout.digest for rollout in found] == [rollout.digest for rollout in here]
    assert [rollout.score for rollout in found] == [rollout.score for rollout in here]
    assert len({rollout.digest for rollout in found}) == 3
    assert (invalid.status, invalid.score) == ("invalid", 0.0)


@pytest.mark.slow
async def test_a_worker_that_dies_is_replaced_and_its_rollout_repeated(
    pool: RolloutPool, tmp_path: Path
) -> None:
    before = pool.pids
    rollout = await pool.run(CAR, trouble(tmp_path, 1, "die"))
    assert rollout.status == "ok"
    assert rollout.digest == simulate(CAR, get_task("movement", {"window": 1})).digest
    assert pool.pids != before
    assert alive(before) == []


@pytest.mark.slow
async def test_a_rollout_that_kills_three_workers_is_recorded_as_crashed(
    pool: RolloutPool, tmp_path: Path
) -> None:
    rollout = await pool.run(CAR, trouble(tmp_path, 9, "die"))
    assert (rollout.status, rollout.score, rollout.trace) == ("crashed", None, None)
    assert rollout.feedback.text == (
        "No score: the simulation was cut off, its process died 3 times."
    )
    assert len(list(tmp_path.iterdir())) == 3
    assert (await pool.run(CAR, get_task("movement", {"window": 1}))).status == "ok"


@pytest.mark.slow
async def test_a_worker_killed_from_outside_in_mid_rollout_harms_no_other(tmp_path: Path) -> None:
    task = get_task("movement", {"window": 1})
    async with RolloutPool(2) as pool:
        hanging = asyncio.create_task(pool.run(CAR, trouble(tmp_path, 1, "sleep")))
        while not list(tmp_path.iterdir()):
            await asyncio.sleep(0.01)
        others = asyncio.gather(*(pool.run(CAR, task) for _ in range(3)))
        found = await others
        (busy,) = tmp_path.iterdir()
        os.kill(int(busy.name), signal.SIGKILL)
        found.append(await hanging)
    assert {(rollout.status, rollout.digest) for rollout in found} == {
        ("ok", simulate(CAR, task).digest)
    }


@pytest.mark.slow
async def test_a_family_that_fails_is_named_here(pool: RolloutPool, tmp_path: Path) -> None:
    with pytest.raises(PluginError, match="scene raised ValueError: no such scene"):
        await pool.run(CAR, trouble(tmp_path, 1, "raise"))
    assert (await pool.run(CAR, get_task("movement", {"window": 1}))).status == "ok"


@pytest.mark.slow
async def test_a_bug_is_raised_here_with_its_traceback(pool: RolloutPool) -> None:
    with pytest.raises(RuntimeError, match=r"(?s)a rollout failed in its worker:.*Traceback.*rate"):
        await pool.run(CAR, get_task("movement"), variation="faster")
    assert (await pool.run(CAR, get_task("movement", {"window": 1}))).status == "ok"


@pytest.mark.slow
async def test_a_worker_that_hangs_is_given_up(tmp_path: Path) -> None:
    async with RolloutPool(1, grace=1.5) as pool:
        hung = await pool.run(CAR, trouble(tmp_path, 1, "sleep"), cpu_limit=0.5)
        assert (hung.status, hung.score) == ("timeout", None)
        assert hung.feedback.text == ("No score: the simulation was cut off, no answer within 2 s.")
        assert (await pool.run(CAR, get_task("movement", {"window": 1}))).status == "ok"


@pytest.mark.slow
async def test_a_worker_that_gets_no_processor_for_long_is_not_given_up() -> None:
    machine, task = CAR, get_task("movement", {"window": 60})
    async with RolloutPool(1, grace=0.1) as pool:
        await pool.run(CAR, get_task("movement", {"window": 1}))  # it has started
        (worker,) = pool.pids

        async def starve() -> None:
            """Let the worker compute for a twentieth of the time."""
            for _ in range(40):
                os.kill(worker, signal.SIGSTOP)
                await asyncio.sleep(0.095)
                os.kill(worker, signal.SIGCONT)
                await asyncio.sleep(0.005)

        rollout, _ = await asyncio.gather(pool.run(machine, task, cpu_limit=1.9), starve())
        assert rollout.status == "ok"
        assert (rollout.wall_seconds or 0.0) > 2.0
        assert pool.pids == (worker,)


@pytest.mark.slow
async def test_closing_ends_workers_in_mid_rollout(tmp_path: Path) -> None:
    async with RolloutPool(2) as pool:
        hanging = asyncio.create_task(pool.run(CAR, trouble(tmp_path, 1, "sleep")))
        while not list(tmp_path.iterdir()):
            await asyncio.sleep(0.01)
        pids = pool.pids
        assert alive(pids) == list(pids)
        hanging.cancel()
        with pytest.raises(asyncio.CancelledError):
            await hanging
        assert len(pool.pids) == 2
        pids += pool.pids
    assert alive(pids) == []


PARENT = """
import asyncio, sys
from agentflow.env.pool.pool import RolloutPool
async def main():
    async with RolloutPool(1) as pool:
        print(*pool.pids, flush=True)
        await asyncio.sleep(60)
asyncio.run(main())
"""


@pytest.mark.slow
def test_a_worker_ends_by_itself_when_its_parent_is_killed() -> None:
    with subprocess.Popen([sys.executable, "-c", PARENT], stdout=subprocess.PIPE) as parent:
        assert parent.stdout is not None
        pid = int(parent.stdout.readline())
        assert alive([pid]) == [pid]
        parent.kill()
    deadline = time.monotonic() + 60.0
    while alive([pid]) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert alive([pid]) == []


def test_a_pool_needs_workers() -> None:
    with pytest.raises(ValueError, match="a pool needs at least one worker, not 0"):
        RolloutPool(0)


@pytest.mark.slow
async def test_workers_that_die_idle_are_no_rollouts_fault() -> None:
    async with RolloutPool(2) as pool:
        await pool.run(LONE_ROOT, get_task("movement"))
        dead = pool.pids
        for pid in dead:
            os.kill(pid, signal.SIGKILL)
        await asyncio.sleep(0.2)
        rollout = await pool.run(LONE_ROOT, get_task("movement"))
        assert rollout.status == "ok"
        assert len(pool.pids) == 2
