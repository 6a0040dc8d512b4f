"""Rollouts and machines that runs have in common."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from pathlib import Path

import pytest

from agentflow.env.archive import save_npz
from agentflow.env.pool.store import Store, rollout_key
from agentflow.env.rollout import Feedback, Rollout
from agentflow.env.simulation.variations import DEFAULT, GENERAL, MOTORS, VARIATIONS, Variation
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.registry import get_task
from agentflow.errors import RunError
from agentflow.machine.tree import ROOT, Machine, Step

BLOCK = Machine((ROOT, Step(1, 63, 0, 4)))
ROLLOUT = Rollout(
    status="ok",
    score=1.5,
    terms={"distance": 1.5},
    problems=(),
    broken=(),
    events=(),
    feedback=Feedback("It stands.", {"moved": 0}),
    trace=None,
    digest="00",
    sim_seconds=5.0,
    wall_seconds=0.1,
    constants="11",
)


class Counter:
    """A simulator that counts what it is asked."""

    def __init__(self, rollout: Rollout = ROLLOUT) -> None:
        self.count = 0
        self._rollout = rollout

    async def run(
        self,
        machine: Machine,  # noqa: ARG002
        task: Task,  # noqa: ARG002
        *,
        seed: int = 0,  # noqa: ARG002
        variation: Variation = DEFAULT,  # noqa: ARG002
        interval: float | None = None,  # noqa: ARG002
    ) -> Rollout:
        self.count += 1
        await asyncio.sleep(0)
        return self._rollout


async def test_a_rollout_is_simulated_once_also_by_two_at_a_time_and_by_later_processes(
    tmp_path: Path,
) -> None:
    counter, task = Counter(), get_task("movement")
    store = Store(tmp_path, counter)
    found = await asyncio.gather(*(store.run(BLOCK, task, seed=3) for _ in range(5)))
    assert found == [ROLLOUT] * 5
    assert await Store(tmp_path, counter).run(BLOCK, task, seed=3) == ROLLOUT
    assert counter.count == 1
    assert [path.name for path in (tmp_path / "rollouts").iterdir()] == [
        f"{rollout_key(BLOCK, task, 3)}.npz"
    ]


async def test_machine_task_knobs_and_seed_tell_rollouts_apart(tmp_path: Path) -> None:
    counter = Counter()
    store = Store(tmp_path, counter)
    await store.run(BLOCK, get_task("movement"), seed=0)
    await store.run(BLOCK, get_task("movement"), seed=1)
    await store.run(BLOCK, get_task("movement/2"), seed=0)
    await store.run(BLOCK, get_task("movement", {"window": 4}), seed=0)
    await store.run(BLOCK, get_task("throwing"), seed=0)
    await store.run(Machine((ROOT,)), get_task("movement"), seed=0)
    assert counter.count == 6


async def test_what_the_computer_failed_at_is_tried_again(tmp_path: Path) -> None:
    failed = Rollout(**{**vars(ROLLOUT), "status": "timeout", "score": None})
    counter = Counter(failed)
    store = Store(tmp_path, counter)
    for _ in range(2):
        assert await store.run(BLOCK, get_task("movement")) == failed
    assert counter.count == 2
    assert list((tmp_path / "rollouts").iterdir()) == []


async def test_what_the_computer_failed_at_is_not_shared(tmp_path: Path) -> None:
    """A run that keeps all rollouts keeps those, too; other runs are to try them again."""
    task, counter = get_task("movement"), Counter()
    rollouts = tmp_path / "run" / "rollouts"
    rollouts.mkdir(parents=True)
    timeout = Rollout(**{**vars(ROLLOUT), "status": "timeout", "score": None})
    save_npz(timeout, rollouts / f"{BLOCK.digest}.npz")
    Store(tmp_path / "store", counter).share(tmp_path / "run", task, seed=2)
    assert await Store(tmp_path / "store", counter).run(BLOCK, task, seed=2) == ROLLOUT
    assert counter.count == 1


async def test_a_damaged_file_is_simulated_anew(tmp_path: Path) -> None:
    counter, task = Counter(), get_task("movement")
    store = Store(tmp_path, counter)
    await store.run(BLOCK, task)
    (path,) = (tmp_path / "rollouts").iterdir()
    for content in (b"", b"PK\x03\x04 half a file", path.read_bytes()[:200]):
        path.write_bytes(content)
        assert await store.run(BLOCK, task) == ROLLOUT
    assert counter.count == 4


async def test_runs_and_store_share_their_files(tmp_path: Path) -> None:
    task, text = get_task("movement"), BLOCK.to_text() + "\n"
    store = Store(tmp_path / "store", Counter())
    await store.run(BLOCK, task, seed=2)
    (kept,) = (tmp_path / "store" / "rollouts").iterdir()
    for name in ("one", "two"):
        run = tmp_path / name
        (run / "machines").mkdir(parents=True)
        (run / "rollouts").mkdir()
        (run / "machines" / f"{BLOCK.digest}.json").write_text(text)
        (run / "rollouts" / f"{BLOCK.digest}.npz").write_bytes(b"the run's own copy")
        store.share(run, task, seed=2)
        store.share(run, task, seed=2)
        assert (run / "rollouts" / f"{BLOCK.digest}.npz").samefile(kept)
    machine = tmp_path / "store" / "machines" / f"{BLOCK.digest}.json"
    assert machine.read_text() == text
    assert machine.stat().st_nlink == 3
    left = {path.name for path in tmp_path.rglob(".*")}
    assert left == set()


def test_a_folder_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(RunError, match=r"cannot write to .*/file/store: Not a directory"):
        Store(tmp_path / "file" / "store", Counter())


@pytest.mark.parametrize("variation", [*GENERAL, *MOTORS])
def test_factors_that_came_later_leave_older_keys_alone(variation: Variation) -> None:
    assert list(variation.key) == ["name", "rate", "masses", "friction", "motor_torque"]
    faster = replace(variation, motor_speed=1.1)
    assert faster.key == {**variation.key, "motor_speed": 1.1}
    assert VARIATIONS["start times +2 %"].key == {
        **DEFAULT.key,
        "name": "start times +2 %",
        "times": 1.02,
    }
