"""Verifying at the bench: what it tells and costs, once, also in a repeated stage."""

from __future__ import annotations

import pytest

from agentflow.app.design.evaluator import _changes_text, _tell
from agentflow.app.design.plan import RunPlan
from agentflow.config.run import DesignConfig
from agentflow.env.verification import Verification
from agentflow.runs import Event
from agentflow.runs.events import RunEvent, typed_event
from tests.tools.benches import CAR, open_bench

from ..env.test_trials import stopped, trial


@pytest.mark.slow
async def test_verifying_is_charged_once_with_its_simulations_and_repeated_as_paid() -> None:
    async with open_bench(rollouts=9) as (bench, recorded):
        await bench.call("check", {"machine": CAR})
        early = await bench.call("verify", {"machine": "6c45a9a7"})
        assert early.refused
        assert "has not been simulated; `simulate` it first" in early.text
        await bench.call("simulate", {"machine": "6c45a9a7"})
        told = await bench.call("verify", {"machine": "6c45a9a7"})
        assert told.text.startswith("Machine 6c45a9a7: verified score ")
        assert "holds in 8 of 8: default " in told.text
        assert "; motor torque -2 % " in told.text
        assert (told.data["simulations_left"], told.data["holds"]) == (1, 8)
        again = await bench.call("verify", {"machine": "6c45a9a7"})
        assert "`default` is as simulated before; this cost 7 simulations." in told.text.replace(
            "8 simulations, 1 of them for changes without effect", "7 simulations"
        )
        assert "; this cost nothing." not in told.text
        assert "; this cost nothing." in again.text
        await bench.call("edit", {"machine": "6c45a9a7", "script": "Add 15 to 0 in 4"})
        await bench.call("simulate", {"machine": "72b0c7bb"})
        beyond = await bench.call("verify", {"machine": "72b0c7bb"})
        assert beyond.text == (
            "verifying machine 72b0c7bb takes 7 simulations, and 0 are left; `submit` it: the "
            "best machine is verified in the end"
        )
        machines = {known.machine.digest: known.machine for known in bench.machines}
    events = [typed_event(Event(*key, data)) for key, data in recorded.events.items()]
    async with open_bench(rollouts=9) as (second, _):
        for event in events:
            assert isinstance(event, RunEvent)
            await second.repeat(event, machines.__getitem__)
        assert "0 of 9 simulations left" in second.budget_text


async def test_the_brief_says_how_the_final_score_is_made_and_what_scores_are_worth() -> None:
    async with open_bench(good=38.0, record=38.9) as (bench, _):
        text = bench.brief_text
    assert " A good score is 38. The best known one is 38.9." in text
    assert (
        "Its final score is the median of its simulation and up to 9 with small changes (4 x step "
        "rate; 2 % more and less of masses, friction, motor torque, pull of springs and winches). "
        "`verify` does this now, at their cost; for the result, it is free."
    ) in text
    async with open_bench(stage="initial", rollouts=None) as (blind, _):
        assert "`verify`" not in blind.brief_text
        assert "good score" not in blind.brief_text
        assert "verify" not in [spec.name for spec in blind.tools]


def test_a_plan_tells_the_good_score_of_its_level_and_the_record_where_asked_for() -> None:
    plan = RunPlan.of(DesignConfig(task="throwing/2"))
    assert (plan.good, plan.record) == (45.0, None)
    asked = DesignConfig.model_validate({"task": "throwing/2", "settings": {"tell_record": True}})
    assert (RunPlan.of(asked).record or 0.0) > 45.0
    assert RunPlan.of(DesignConfig(task="throwing/2", knobs={"window": 4})).good is None


def test_what_fails_is_told_with_every_score() -> None:
    whole = Verification({"default": trial(1, True), "masses +2 %": trial(2, False)})
    told = _tell(whole)
    assert told.text == (
        "verified score 0.50 (0.00 to 1.00), holds in 1 of 2, fragile: default 1.00; "
        "masses +2 % 0.00"
    )
    assert told.data["fails"] == ["masses +2 %"]
    cut = _tell(Verification({"default": trial(1, True), "masses +2 %": stopped("timeout")}))
    assert cut.text == (
        "not verified, because simulations stopped early: default 1.00; masses +2 % timeout"
    )
    assert cut.data["score"] is None


def test_changes_both_ways_are_named_once() -> None:
    names = ["4 x step rate", "masses +2 %", "masses -2 %", "thrust +2 %", "thrust -2 %"]
    assert _changes_text(names) == "4 x step rate; 2 % more and less of masses, thrust"
