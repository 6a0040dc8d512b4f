"""Judged replies and their numbers."""

from __future__ import annotations

from itertools import combinations
from statistics import fmean, pstdev

import pytest

from agentflow.metrics.intervals import bootstrap_mean, wilson
from agentflow.rewards import Sample, Scorer
from agentflow.training.evaluation.replies import JudgedReply, judge, summarise
from tests.integrations.foreign import CAR

OVERLAP = """A rationale. ```json
[{"type": 0, "id": 0, "parent": -1, "face_id": -1},
 {"type": 41, "id": 1, "parent": 0, "face_id": 0},
 {"type": 41, "id": 2, "parent": 0, "face_id": 0}]```"""


def reply(score: float | None, *, valid: bool = True, status: str = "ok") -> JudgedReply:
    return JudgedReply(
        task="throwing",
        seed=0,
        text="",
        parsed=True,
        spatial=valid,
        valid=valid,
        status=status,
        score=score,
        machine=[],
    )


@pytest.mark.slow
def test_replies_are_judged_by_real_simulation() -> None:
    scorer = Scorer(workers=1)
    try:
        texts = (f"It drives.\n```json\n{CAR}\n```", "no machine at all", OVERLAP)
        car, nothing, twice = judge([Sample("movement", text, 3) for text in texts], scorer)
    finally:
        scorer.close()
    assert (car.parsed, car.spatial, car.valid, car.status, car.problem) == (
        *(True, True, True),
        *("ok", ""),
    )
    assert car.score is not None
    assert car.score > 5
    assert car.machine is not None
    assert car.machine[0] == {"type": 0, "id": 0, "parent": -1, "face_id": -1}
    assert (nothing.parsed, nothing.valid, nothing.status) == (False, False, "invalid")
    assert (nothing.score, nothing.machine, nothing.seed) == (0.0, None, 3)
    assert (twice.valid, twice.score, twice.problem) == (False, 0.0, "face_occupied")
    assert JudgedReply.model_validate_json(car.model_dump_json()) == car


def test_the_numbers_are_those_of_all_replies_with_invalid_ones_at_0() -> None:
    scores = [4.0, 0.0, 7.5, 1.25]
    found = summarise([*map(reply, scores), reply(0.0, valid=False), reply(0.0, valid=False)])
    every = [*scores, 0.0, 0.0]
    assert (found.replies, found.faults, str(found.valid)) == (6, 0, "4/6")
    assert found.valid.interval == wilson(4, 6)
    assert (found.mean, found.sd, found.scores.max) == (fmean(every), pstdev(every), 7.5)
    data = found.to_json()
    assert data["mean_interval"] == bootstrap_mean(found.scores.all, 0)
    assert data["mean_valid"] == fmean(scores)
    for n in (1, 2, 4):
        best = fmean(max(some) for some in combinations(every, n))
        assert data["best_at"][n] == pytest.approx(best)


def test_faults_are_counted_and_left_out_of_every_number() -> None:
    sound = [reply(4.0), reply(0.0, valid=False)]
    faulty = [reply(None, status="crashed"), reply(None, status="timeout")]
    with_faults, without = summarise([*sound, *faulty]), summarise(sound)
    assert with_faults.faults == 2
    assert with_faults.to_json() == {**without.to_json(), "faults": 2}


def test_nothing_but_faults_has_no_numbers() -> None:
    found = summarise([reply(None, status="crashed")])
    assert (found.replies, found.faults, found.mean, found.sd) == (0, 1, None, None)
    assert found.valid.interval is None
    assert found.to_json()["best_at"] == {}
