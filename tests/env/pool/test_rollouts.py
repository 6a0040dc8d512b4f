"""Rollouts of a run: the same whether they lie in memory or in a file."""

from __future__ import annotations

import pickle
import resource
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from agentflow.env.pool.store import Rollouts
from agentflow.env.rollout import Rollout
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.registry import get_task
from agentflow.errors import RunError
from agentflow.machine.tree import ROOT, Machine, Step


@pytest.fixture(scope="module")
def rollout() -> Rollout:
    return simulate(Machine((ROOT, Step(1, 63, 0, 4))), get_task("movement"))


@pytest.mark.parametrize("in_memory", [1, 2**20])
def test_what_was_put_in_comes_out_to_the_bit_and_in_order(
    rollout: Rollout, in_memory: int
) -> None:
    rollouts = Rollouts(in_memory)
    others = {key: replace(rollout, score=float(score)) for score, key in enumerate("cab")}
    for key, other in others.items():
        rollouts.put(key, other)
    assert list(rollouts) == ["c", "a", "b"]
    assert len(rollouts) == 3
    for key in "bca":
        assert pickle.dumps(rollouts[key]) == pickle.dumps(pickle.loads(pickle.dumps(others[key])))
    with pytest.raises(KeyError):
        rollouts["d"]


def test_memory_does_not_grow_with_their_number(rollout: Rollout) -> None:
    assert rollout.trace is not None
    large = replace(rollout, trace=replace(rollout.trace, times=np.zeros(2**17)))  # 1 MiB
    rollouts = Rollouts(2**20)
    tracemalloc.start()
    try:
        for number in range(20):
            rollouts.put(str(number), large)
        assert tracemalloc.get_traced_memory()[1] < 8 * 2**20
    finally:
        tracemalloc.stop()


def test_a_place_without_room_is_told(rollout: Rollout) -> None:
    rollouts = Rollouts(1)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, hard))
    try:
        with pytest.raises(RunError) as error:
            rollouts.put("a", rollout)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert str(error.value) == (
        "cannot write a temporary file: File too large; set TMPDIR to a directory with free space"
    )
    assert len(rollouts) == 0
    for what in (lambda: rollouts.put("b", rollout), lambda: rollouts["a"]):
        with pytest.raises(RunError) as later:
            what()
        assert later.value is error.value
