"""What agents measure: numbers as data, steps of a simulation, single trials."""

from __future__ import annotations

import pytest

from tests.tools.benches import CAR, open_bench

QUERY = {"id": 3, "duration": [0, 0.1], "properties": ["joint_angle", "joint_speed", "load"]}


@pytest.mark.slow
async def test_answers_are_numbers_down_to_a_step() -> None:
    async with open_bench() as (bench, record):
        name = (await bench.call("check", {"machine": CAR})).data["machine"]
        simulated = await bench.call("simulate", {"machine": name})
        numbers = simulated.data["numbers"]
        assert numbers["score"] == pytest.approx(simulated.data["score"], rel=1e-4)
        assert numbers["energy"]["motors"] > 100.0
        (usual,) = (await bench.call("query", {"machine": name, "queries": [QUERY]})).data[
            "answers"
        ]
        given = {"machine": name, "queries": [QUERY], "interval": 0.001}
        (fine,) = (await bench.call("query", given)).data["answers"]
        assert fine["times"] == pytest.approx([step / 120 for step in range(13)], abs=1e-4)
        assert len(usual["times"]) < 6
        shared = [fine["times"].index(time) for time in usual["times"]]
        for key in ("joint_angle", "joint_speed"):  # the same simulation again
            assert [fine[key][index] for index in shared] == usual[key]
        refused = await bench.call("query", {**given, "trial": 2})
        assert "no answer: this task has no trials; leave out `trial`" in refused.text
        assert refused.data["answers"][0]["problem"] == "this task has no trials; leave out `trial`"
        assert "2 of 3 simulations left" in bench.budget_text
    assert record.events["query", "env_feedback/call-4"]["queries"][0]["interval"] == 0.001


@pytest.mark.slow
async def test_every_trial_can_be_looked_at() -> None:
    async with open_bench("jumping/4", looks=4) as (bench, _):
        name = (await bench.call("check", {"machine": CAR})).data["machine"]
        told = await bench.call("simulate", {"machine": name})
        shown = told.data["numbers"]["shown_trial"]
        heights = {}
        for trial in (1, 2, shown):
            one = await bench.call("simulate", {"machine": name, "trial": trial})
            outcome = told.data["numbers"]["trials"][trial - 1]["outcome"]
            assert one.text.splitlines()[1:3] == [f"Trial {trial}:", f"Result: {outcome}"]
            query = {"id": 0, "duration": [0, 2], "properties": ["position"]}
            given = {"machine": name, "queries": [query], "trial": trial}
            (answer,) = (await bench.call("query", given)).data["answers"]
            assert answer["trial"] == trial
            heights[trial] = answer["position"]
            seen = await bench.call("look", {"machine": name, "time": 1.0, "trial": trial})
            assert bool(seen.image) is not seen.refused
        assert heights[1] != heights[2]
        del given["trial"]
        (usual,) = (await bench.call("query", given)).data["answers"]
        assert (usual["trial"], usual["position"]) == (shown, heights[shown])
        for tool, more in (("simulate", {}), ("look", {"time": 1.0})):
            refused = await bench.call(tool, {"machine": name, "trial": 11, **more})
            assert refused.text == "there is no trial 11; trials go from 1 to 10"
        assert "2 of 3 simulations left" in bench.budget_text
