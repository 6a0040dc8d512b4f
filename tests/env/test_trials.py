"""Trials: how ten rollouts become one, the same here and in a pool, whatever happens to one."""

from __future__ import annotations

import os
import signal
from dataclasses import dataclass, replace
from itertools import count

import pytest

from agentflow.env.archive import rollout_json
from agentflow.env.pool.pool import RolloutPool
from agentflow.env.rollout import Feedback, Rollout
from agentflow.env.scene import Scene
from agentflow.env.simulation import trial as trial_module
from agentflow.env.simulation.simulate import simulate
from agentflow.env.simulation.trials import combine_trials, middle_trial
from agentflow.env.tasks.families.jumping import Jumping, JumpingKnobs
from agentflow.env.tasks.registry import get_task
from agentflow.machine.tree import Machine

from .fakes import LONE_ROOT, make_rollout, make_trace

TASK = get_task("jumping", {"window": 1})


def trial(number: int, success: bool, miss: float | None = None) -> Rollout:
    """A rollout as a trial gives it."""
    outcome = "success, over" if success else f"failed, {miss} m short"
    return replace(
        make_rollout(make_trace(1)),
        score=float(success),
        terms={"success": success, "outcome": outcome, "miss": miss},
        feedback=Feedback(f"Score: {success:.2f}\nResult: {outcome}", {"score": float(success)}),
        digest=f"{number:032x}",
        sim_seconds=1.0,
        wall_seconds=0.5,
    )


def stopped(status: str) -> Rollout:
    """A rollout that was not played to its end."""
    return replace(
        make_rollout(None),
        status=status,  # type: ignore[arg-type]
        score=0.0 if status == "diverged" else None,
        feedback=Feedback(f"The simulation: {status}.", {"status": status}),
    )


def test_a_single_rollout_stays_as_it_is() -> None:
    only = trial(1, False)
    assert combine([only]) is only


def combine(played: list[Rollout]) -> Rollout:
    return combine_trials(played, TASK.trials(0)[: len(played)])


def test_the_middle_trial_is_that_of_middle_conditions_whatever_their_units() -> None:
    near = [get_task("jumping", {"walls": {"first": z}}) for z in (12, 30, 20, 21)]
    assert middle_trial(near) == 2
    mixed = [
        get_task("jumping", {"walls": {"first": z}, "yaw": yaw})
        for z, yaw in ((12, 0.1), (20, 0.0), (21, 5.0), (30, 0.2))
    ]
    assert middle_trial(mixed) == 1
    assert middle_trial(TASK.trials(0)) == middle_trial(get_task("jumping").trials(0))


def test_successes_are_counted_and_the_middle_trial_is_shown() -> None:
    played = [trial(1, True), trial(2, False, 0.5), trial(3, False, 0.25), trial(4, True)]
    index = middle_trial(TASK.trials(0)[:4])
    whole = combine(played)
    assert (whole.status, whole.score, whole.sim_seconds, whole.wall_seconds) == ("ok", 2, 4, 2)
    assert whole.trace is played[index].trace
    assert dict(whole.terms) == {
        "successes": 2.0,
        "trials": 4.0,
        "shown_trial": index + 1.0,
        "closest_miss": 0.25,
        "trial_1": True,
        "outcome_1": "success, over",
        "trial_2": False,
        "outcome_2": "failed, 0.5 m short",
        "trial_3": False,
        "outcome_3": "failed, 0.25 m short",
        "trial_4": True,
        "outcome_4": "success, over",
    }
    assert whole.feedback.text == (
        "Score: 2.00 successful trials out of 4\n"
        "Trials 1, 4: success, over\n"
        "Trials 2, 3: failed, 0.25 to 0.5 m short\n"
        f"Everything below is about trial {index + 1}, whose conditions are the middle ones:\n"
        f"Result: {played[index].terms['outcome']}"
    )
    data = whole.feedback.data
    assert (data["score"], data["shown_trial"]) == (2.0, index + 1)
    assert [item["success"] for item in data["trials"]] == [True, False, False, True]


def test_an_outcome_that_is_the_shown_trials_alone_is_not_repeated() -> None:
    index = middle_trial(TASK.trials(0)[:4])
    played = [trial(number, number == index + 1, 0.5) for number in (1, 2, 3, 4)]
    text = combine(played).feedback.text
    assert f"Trial {index + 1}: success, over\n" in text
    assert "Result" not in text


def test_outcomes_that_differ_in_shares_alone_share_a_line() -> None:
    played = [trial(number, True) for number in (1, 2)]
    played = [
        replace(each, terms={**each.terms, "outcome": f"success, {share}% of the mass"})
        for each, share in zip(played, (52, 100), strict=True)
    ]
    assert "All 2 trials: success, 52 to 100% of the mass\n" in combine(played).feedback.text


def test_the_digest_is_over_all_trials_in_their_order() -> None:
    one, two, three = trial(1, True), trial(2, True), trial(3, True)
    digests = {combine(each).digest for each in ([one, two], [two, one], [one, three])}
    assert len(digests) == 3
    assert combine([one, two]).digest == combine([one, two]).digest


def test_a_trial_that_diverges_is_a_failed_one() -> None:
    whole = combine([trial(1, True), stopped("diverged"), trial(3, True)])
    assert (whole.status, whole.score, whole.terms["trial_2"]) == ("ok", 2.0, False)
    assert whole.terms["outcome_2"] == "the simulation diverged"
    assert "Trial 2: the simulation diverged\n" in whole.feedback.text
    everywhere = combine([stopped("diverged"), stopped("diverged")])
    assert (everywhere.status, everywhere.score) == ("diverged", 0.0)


@pytest.mark.parametrize("status", ["timeout", "crashed", "invalid"])
def test_what_stops_one_trial_stops_all(status: str) -> None:
    cut = stopped(status)
    assert combine([trial(1, True), cut, stopped("timeout")]) is cut


def test_trials_are_the_seeds_and_within_their_limits() -> None:
    level = get_task("jumping")
    first, again, other = level.trials(0), level.trials(0), level.trials(1)
    assert first == again
    assert first != other
    assert len(first) == 10
    assert len(set(first)) == 10
    for one in (*first, *other):
        assert one.trials(5) == (one,)
        knobs = one.parameters
        assert isinstance(knobs, JumpingKnobs)
        assert 11 <= knobs.walls.first <= 13
        assert 0.45 <= knobs.walls.height <= 0.55
        assert 0.72 <= knobs.friction <= 0.88
        assert -2 <= knobs.yaw <= 2


@pytest.mark.slow
def test_the_whole_is_what_its_trials_are_in_any_order() -> None:
    whole = simulate(LONE_ROOT, TASK, seed=3)
    alone = [simulate(LONE_ROOT, one) for one in reversed(TASK.trials(3))]
    again = combine_trials(alone[::-1], TASK.trials(3))
    assert (whole.score, whole.status) == (0.0, "ok")
    assert whole.digest == again.digest
    assert whole.feedback == again.feedback
    assert simulate(LONE_ROOT, TASK, seed=4).digest != whole.digest


@pytest.mark.slow
async def test_a_pool_gives_the_same_with_one_worker_and_with_two() -> None:
    here = rollout_json(simulate(LONE_ROOT, TASK)) | {"wall_seconds": 0}
    for workers in (1, 2):
        async with RolloutPool(workers) as pool:
            there = await pool.run(LONE_ROOT, TASK)
        assert rollout_json(there) | {"wall_seconds": 0} == here
        shown = int(there.terms["shown_trial"] or 0)
        assert there.scene == TASK.trials(0)[shown - 1].scene(LONE_ROOT)


def test_the_cpu_limit_is_each_trials(monkeypatch: pytest.MonkeyPatch) -> None:
    """Clocks advance by 1/1024 s whenever one is read, which happens once per step."""
    ticks = count()
    for clock in ("perf_counter", "thread_time"):
        monkeypatch.setattr(trial_module, clock, lambda: next(ticks) / 1024)
    trials = [simulate(LONE_ROOT, trial).wall_seconds or 0.0 for trial in TASK.trials(0)]
    whole = simulate(LONE_ROOT, TASK, cpu_limit=max(trials))
    assert (whole.status, whole.wall_seconds) == ("ok", sum(trials))
    cut = simulate(LONE_ROOT, TASK, cpu_limit=0.9 * min(trials))
    assert (cut.status, cut.score, cut.trace) == ("timeout", None, None)


@dataclass(frozen=True)
class Deadly(Jumping):
    """Jumping whose third trial kills the process that builds its scene."""

    keeper: int = 0
    """The process that it spares."""

    def scene(self, machine: Machine | None = None) -> Scene:
        if self.trial == 3 and os.getpid() != self.keeper:
            os.kill(os.getpid(), signal.SIGKILL)
        return super().scene(machine)


@pytest.mark.slow
async def test_a_trial_that_crashes_makes_the_whole_crashed() -> None:
    assert isinstance(TASK, Jumping)
    task = Deadly(TASK.name, 1, TASK.parameters, 1.0, TASK.schedule, keeper=os.getpid())
    async with RolloutPool(2) as pool:
        rollout = await pool.run(LONE_ROOT, task)
        assert (rollout.status, rollout.score) == ("crashed", None)
        assert (await pool.run(LONE_ROOT, TASK)).status == "ok"
    assert simulate(LONE_ROOT, task).status == "ok"
