"""The tools on real physics: what they give, what they cost, what they refuse."""

from __future__ import annotations

import asyncio
import json
from io import BytesIO

import pytest
from PIL import Image

from agentflow.tools.results import StageEnded
from tests.tools.benches import CAR, open_bench

ENDED = str(StageEnded())


@pytest.mark.slow
async def test_a_whole_session() -> None:
    async with open_bench() as (bench, record):
        assert [tool.name for tool in bench.tools] == [
            "brief", "check", "describe", "edit", "simulate", "verify", "explore_edits", "query",
            "look", "history", "submit",
        ]  # fmt: skip
        told = await bench.call("brief", None)
        assert "### Scene" in told.text
        assert "2 of 2 submissions left, 3 of 3 simulations left, 2 of 2 pictures left" in told.text

        checked = await bench.call("check", {"machine": CAR})
        name = checked.data["machine"]
        assert checked.text.startswith(f"Machine {name}: valid, ")
        assert len(name) == 8

        described = await bench.call("describe", {"machine": name, "short": True})
        assert described.text.startswith(f"Machine {name}, in the machine frame\n")
        assert described.data["tree"] == json.loads(CAR)

        simulated = await bench.call("simulate", json.dumps({"machine": name}))
        assert simulated.data["status"] == "ok"
        assert simulated.data["simulations_left"] == 2
        assert simulated.text.startswith(
            f"Machine {name}: score {simulated.data['score']:.2f}. In the world frame; forces and "
            "moments along the axes of blocks as built:\nScore: "
        )
        again = await bench.call("simulate", {"machine": name})
        assert "was simulated before, so this cost nothing" in again.text
        assert again.data["simulations_left"] == 2

        asked = [{"id": 0, "duration": [0, 1], "properties": ["position"]}]
        answer = await bench.call("query", {"machine": name, "queries": asked})
        assert answer.text.startswith("In the world frame:\nBlock 0 (Starting Block), 0 to 1 s:")

        for given, size, left in (
            ({"view": "side"}, (640, 480), 2),
            ({"view": "side", "time": 1.0, "follow": 3, "within": 2}, (640, 480), 1),
            ({"moments": [0, 1, 2, 3]}, (960, 720), 0),
            ({}, (640, 480), 0),
        ):
            seen = await bench.call("look", {"machine": name, **given})
            assert seen.image is not None
            assert Image.open(BytesIO(seen.image)).size == size
            assert seen.data["pictures_left"] == left
        spent = await bench.call("look", {"machine": name, "time": 1})
        assert spent.refused
        assert spent.text.startswith(
            "all 2 pictures are used; the other tools still work, and `look` without a time costs"
        )

        last = len(json.loads(CAR)) - 1
        edited = await bench.call("edit", {"machine": name, "script": f"Remove {last}"})
        assert edited.data["parent"] == name
        assert (
            f"Changes from {name}: {last} of {last + 1} blocks kept; removed {last}." in edited.text
        )

        table = await bench.call("history", {})
        assert [row["machine"] for row in table.data["machines"]] == [name, edited.data["machine"]]
        assert [row["parent"] for row in table.data["machines"]] == [None, name]

        assert not (await bench.call("submit", {"machine": name})).refused
        assert not bench.ended
        final = await bench.call("submit", {"machine": edited.data["machine"]})
        assert final.text.splitlines()[-2:-1] == ["This stage has ended."]
        await asyncio.wait_for(bench.wait_ended(), 1)
        assert [machine.digest[:8] for machine in bench.submitted] == [name, edited.data["machine"]]
        after = await bench.call("history", {})
        assert after.text == "this stage has ended; nothing more can be done in it"
        tools = [key for key in record.events if key[0] == "tool"]
        assert tools[-1] == ("tool", f"env_feedback/call-{len(tools)}")


@pytest.mark.parametrize(
    ("tool", "arguments", "words"),
    [
        ("simulate", {"machine": "deadbeef"}, "there is no machine 'deadbeef'; there is none yet"),
        ("simulate", "{", "the arguments are not JSON"),
        ("simulate", [1], "the arguments are a list; send a JSON object"),
        ("simulate", {}, "simulate takes machine, trial; machine is missing"),
        (
            "simulate",
            {"machine": 3},
            "simulate takes machine, trial; machine.str: Input should be a valid str",
        ),
        ("check", {"machine": "x" * 1_000_000}, "an argument has 1000000 characters"),
        ("check", {"machine": "no machine"}, "The machine is not valid:\n- no JSON list found"),
        (
            "query",
            {
                "machine": "x",
                "queries": [{"id": "x" * 81, "duration": [0, 1], "properties": ["position"] * 9}],
            },
            "String should have at most 80 characters; queries.0.properties: List should have at "
            "most 8 items",
        ),
        ("fly", {}, "the tool 'fly' does not exist; the tools are brief, check"),
        ("brief", {"a": "\ud800"}, "brief takes no arguments; a: Extra inputs"),
    ],
)
async def test_refusals_say_what_to_change(tool: str, arguments: object, words: str) -> None:
    async with open_bench() as (bench, _):
        result = await bench.call(tool, arguments)
    assert result.refused
    assert words in result.text
    assert result.data["refused"] == result.text


async def test_describe_tells_what_joints_hit_unless_short() -> None:
    async with open_bench("throwing") as (bench, _):
        root = '[{"type": 0, "id": 0, "parent": -1, "face_id": -1}]'
        made = await bench.call("check", {"machine": root})
        assert made.text.startswith(f"Machine {made.data['machine']}: valid so far, but not compl")
        refused = await bench.call("simulate", {"machine": made.data["machine"]})
        assert refused.text.startswith("this machine is not complete: the task requires exactly 1")
        script = "Add 22 to 0 in 3 as m\nAdd 63 to m in 3 as a\nAdd 63 to 0 in 4 as t"
        arm = await bench.call("edit", {"machine": made.data["machine"], "script": script})
        assert arm.text.endswith("added 1 m, 2 a, 3 t.")
        told = await bench.call("describe", {"machine": arm.data["machine"]})
        assert "1 Rotating Block carries 2" in told.data["statics"]
        assert told.text.endswith(told.data["statics"])
        short = await bench.call("describe", {"machine": arm.data["machine"], "short": True})
        assert short.data["statics"] == ""
        assert len(short.text) < len(told.text)


@pytest.mark.slow
async def test_the_greatest_possible_score_is_told() -> None:
    async with open_bench("movement", greatest=40.0) as (bench, _):
        name = (await bench.call("check", {"machine": CAR})).data["machine"]
        result = await bench.call("simulate", {"machine": name})
    assert "No machine can score higher; `submit` it." in result.text


async def test_what_an_agent_sends_is_recorded_as_data() -> None:
    name = "<script>" * 20
    async with open_bench() as (bench, record):
        await bench.call(name, {"a": "x" * 5000, "b": [1] * 50, "\ud800": float("nan")})
        await bench.call("edit", {"machine": "x", "script": "y"})
        made = await bench.call("check", {"machine": json.loads(CAR)})
        await bench.call("edit", {"machine": made.data["machine"], "script": "Remove 99"})
    unknown = record.events["tool", "env_feedback/call-1"]
    assert unknown["tool"] == "unknown"
    assert unknown["arguments"] == {
        "a": "x" * 2000 + "... (5000 characters)",
        "b": [*[1] * 20, "..."],
        "\ufffd": "nan",
    }
    codes = [record.events["tool", f"env_feedback/call-{n}"]["code"] for n in (2, 3, 4)]
    assert codes == ["", "", "block_not_found"]


@pytest.mark.slow
async def test_concurrent_calls_cannot_overspend_and_identical_ones_cost_once() -> None:
    async with open_bench(rollouts=2) as (bench, _):
        name = (await bench.call("check", {"machine": CAR})).data["machine"]
        names = [name]
        for block in range(len(json.loads(CAR)) - 1, 2, -1):
            made = await bench.call("edit", {"machine": names[-1], "script": f"Remove {block}"})
            names += [made.data["machine"]] if not made.refused else []
        assert len(names) > 3
        wanted = [name, name, name, *names[1:4]]
        results = await asyncio.gather(*(bench.call("simulate", {"machine": n}) for n in wanted))
    assert [result.refused for result in results] == [False, False, False, False, True, True]
    assert results[-1].text.startswith("all 2 simulations are used")


@pytest.mark.slow
async def test_a_cancelled_simulation_frees_its_worker_and_is_not_charged() -> None:
    async with open_bench(rollouts=1) as (bench, _):
        name = (await bench.call("check", {"machine": CAR})).data["machine"]
        first = asyncio.ensure_future(bench.call("simulate", {"machine": name}))
        second = asyncio.ensure_future(bench.call("simulate", {"machine": name}))
        await asyncio.sleep(0.05)
        for call in (first, second):
            call.cancel()
        done = await asyncio.gather(first, second, return_exceptions=True)
        assert [type(item) for item in done] == [asyncio.CancelledError] * 2
        result = await bench.call("simulate", {"machine": name})
    assert result.data["simulations_left"] == 0
    assert result.data["status"] == "ok"


async def test_blind_stages_offer_no_simulation() -> None:
    async with open_bench(stage="initial", rollouts=None, looks=None) as (bench, _):
        offered = {tool.name for tool in bench.tools}
        assert offered == {"brief", "check", "describe", "edit", "history", "submit"}
        refused = await bench.call("simulate", {"machine": "x"})
    assert refused.text.startswith("the tool 'simulate' is not on offer in this stage")


@pytest.mark.slow
async def test_concurrent_submissions_stay_within_the_budget() -> None:
    async with open_bench(submissions=1) as (bench, record):
        name = (await bench.call("check", {"machine": CAR})).data["machine"]
        made = await bench.call("edit", {"machine": name, "script": "Add 15 to 0 in 4"})
        names = [name, name, made.data["machine"]]
        calls = [asyncio.ensure_future(bench.call("submit", {"machine": n})) for n in names]
        await asyncio.wait(calls, return_when="FIRST_COMPLETED")
        await bench.close()
        noted = [record.events["tool", f"env_feedback/call-{n}"]["refused"] for n in (3, 4, 5)]
        results = await asyncio.gather(*calls)
    assert sorted(result.refused for result in results) == [False, True, True]
    assert noted == [result.refused for result in results]
    assert {result.text for result in results if result.refused} == {ENDED}
    assert len(bench.submitted) == 1
    assert "0 of 1 submissions left" in bench.budget_text


async def test_the_end_of_a_stage_cancels_calls_in_progress_at_no_charge() -> None:
    async with open_bench(rollouts=1) as (bench, record):
        name = (await bench.call("check", {"machine": CAR})).data["machine"]
        call = asyncio.ensure_future(bench.call("simulate", {"machine": name}))
        await asyncio.sleep(0)
        bench.end("the client left")
        await bench.close()
        assert record.events["tool", "env_feedback/call-2"]["answer"] == ENDED
        assert not [kind for kind, _ in record.events if kind == "evaluation"]
    assert (await call).refused
    assert "1 of 1 simulations left" in bench.budget_text


async def test_the_brief_of_a_bench_says_that_no_trials_revise_controls() -> None:
    async with open_bench("transport") as (bench, _):
        assert "A machine has 3 trials." in bench.brief_text
        assert "\nHere, no trials revise the controls: a machine with other" in bench.brief_text
    async with open_bench() as (bench, _):
        assert "no trials" not in bench.brief_text
