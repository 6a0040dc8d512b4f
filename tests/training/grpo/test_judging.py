"""Rewards of replies that are written and simulated at the same time."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from typing import Any, cast

import pytest

from agentflow.errors import UnknownNameError
from agentflow.rewards import Scorer
from agentflow.training.grpo.judging import Judging, performance, shaped
from tests.integrations.foreign import CAR
from tests.training.grpo.stand_ins import TableScorer


@pytest.fixture(scope="module")
def scorer() -> Iterator[Scorer]:
    scorer = Scorer(workers=2)
    yield scorer
    scorer.close()


def judging(scorer: Any) -> Judging:
    return Judging(cast("Scorer", scorer), performance, "auto")


@pytest.mark.slow
def test_real_replies_are_judged_in_their_order(scorer: Scorer) -> None:
    found = Judging(scorer, shaped, "auto")
    found.hand_over(["movement", "throwing"], [CAR, CAR])
    words, drives, throws = found.collect(["movement", "movement", "throwing"], ["no", CAR, CAR])
    assert (words.parsed, words.reward, words.score) == (False, 0, 0)
    assert drives.valid
    assert drives.score is not None
    assert drives.score > 10
    assert (drives.reward or 0) > 1
    assert (throws.parsed, throws.spatial, throws.valid) == (True, True, False)
    assert throws.reward == pytest.approx(0.3)
    assert words.machine is None
    assert drives.machine == throws.machine


def test_identical_replies_are_simulated_once() -> None:
    table = TableScorer({"a": 1.0, "b": 2.0})
    found = judging(table)
    found.hand_over(["movement"] * 3, ["a", "b", "a"])
    assert table.submitted == ["a", "b"]
    for _ in range(2):
        judged = found.collect(["movement"] * 4, ["a", "a", "b", "a"])
        assert [one.score for one in judged] == [1, 1, 2, 1]
    assert table.submitted == ["a", "b"]
    found.hand_over(["movement/2"], ["a"])
    assert table.submitted == ["a", "b", "a"], "another task is another reply"


def test_a_reply_whose_simulation_failed_has_no_reward_and_is_tried_again() -> None:
    table = TableScorer({"a": 1.0, "crash": None})
    found = judging(table)
    for _ in range(2):
        judged = found.collect(["movement"] * 3, ["crash", "a", "crash"])
        assert [(one.reward, one.score) for one in judged] == [(None, None), (1, 1), (None, None)]
    assert table.submitted == ["crash", "a", "crash", "crash", "crash"]


def test_replies_like_one_whose_simulation_failed_are_judged_by_a_second_one() -> None:
    table = TableScorer({"a": 1.0, "slow": [None, 2.0], "alone": None})
    judged = judging(table).collect(["movement"] * 4, ["slow", "a", "slow", "alone"])
    assert [one.score for one in judged] == [2, 1, 2, None]
    assert table.submitted == ["slow", "a", "alone", "slow"]


def test_the_oldest_reply_is_forgotten_only_once_its_step_is_judged() -> None:
    table = TableScorer({"a": 1.0, "b": 2.0, "c": 3.0})
    found = Judging(cast("Scorer", table), performance, "auto", remembered=2)
    found.collect(["movement"] * 2, ["a", "b"])
    judged = found.collect(["movement"] * 3, ["c", "b", "a"])
    assert [one.score for one in judged] == [3, 2, 1]
    assert table.submitted == ["a", "b", "c"]
    found.collect(["movement"], ["a"])
    assert table.submitted == ["a", "b", "c", "a"]


@pytest.mark.slow
def test_a_worker_that_dies_is_replaced(scorer: Scorer) -> None:
    found = Judging(scorer, shaped, "auto")
    os.kill(scorer.pool.pids[0], signal.SIGKILL)
    (judged,) = found.collect(["movement/2"], [CAR])
    assert judged.score is not None


def test_an_unknown_task_is_an_error(scorer: Scorer) -> None:
    with pytest.raises(UnknownNameError):
        judging(scorer).collect(["swimming"], [CAR])
