"""Rollouts that processes share behind a URL."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from uuid import uuid4

import pytest

from agentflow.cluster.store import RemoteStore
from agentflow.env.rollout import Feedback, Rollout
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.registry import get_task
from agentflow.errors import ConfigError, RunError
from tests.env.pool.test_pool import CAR
from tests.env.pool.test_store import BLOCK, ROLLOUT, Counter

pytest.importorskip("fsspec")
pytestmark = pytest.mark.cluster


@pytest.fixture(params=["memory", "file"])
def url(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    return f"memory://{uuid4().hex}" if request.param == "memory" else f"file://{tmp_path}/store"


async def test_a_rollout_is_simulated_once_for_all_processes(url: str) -> None:
    task = get_task("movement")
    first, second = Counter(), Counter()
    for counter in (first, second):  # each as another process would open it
        store = RemoteStore(url, counter)
        assert [await store.run(BLOCK, task) for _ in range(2)] == [ROLLOUT] * 2
        await store.run(BLOCK, task, seed=1)
    assert (first.count, second.count) == (2, 0)


async def test_a_whole_rollout_comes_back(url: str) -> None:
    task = get_task("movement", {"window": 1})
    here = simulate(CAR, task)
    await RemoteStore(url, Counter(here)).run(CAR, task)
    found = await RemoteStore(url, Counter()).run(CAR, task)
    assert (found.digest, found.score, found.status) == (here.digest, here.score, here.status)
    assert found.trace is not None
    assert here.trace is not None
    assert (found.trace.centre == here.trace.centre).all()


async def test_faults_are_not_stored_and_damaged_files_are_replaced(tmp_path: Path) -> None:
    task, url = get_task("movement"), f"file://{tmp_path}"
    crash = Counter(Rollout("crashed", None, Feedback("It crashed.", {})))
    for _ in range(2):
        await RemoteStore(url, crash).run(BLOCK, task)
    assert crash.count == 2
    await RemoteStore(url, Counter()).run(BLOCK, task)
    (file,) = (tmp_path / "rollouts").iterdir()  # and nothing half-written
    file.write_bytes(b"PK")
    better = Counter(replace(ROLLOUT, score=2.5))
    assert (await RemoteStore(url, better).run(BLOCK, task)).score == 2.5
    assert (await RemoteStore(url, Counter()).run(BLOCK, task)).score == 2.5


async def test_what_cannot_be_used_is_said(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"the store nowhere://x is not the URL of a file system"):
        RemoteStore("nowhere://x", Counter())
    (tmp_path / "rollouts").write_text("a file")
    with pytest.raises(RunError, match=f"cannot use the store file://{tmp_path}: "):
        await RemoteStore(f"file://{tmp_path}", Counter()).run(BLOCK, get_task("movement"))
