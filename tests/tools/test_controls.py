"""Tools on a task whose machines bring control programs, in real physics."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.tools.benches import CAR, open_bench

LEVEL = "family: movement\ntitle: drive\ngood: 1\ncontrols: designed\nparameters: {window: 1}\n"


@pytest.mark.slow
async def test_agents_write_edit_and_simulate_programs(tmp_path: Path) -> None:
    level = tmp_path / "designed.yaml"
    level.write_text(LEVEL, encoding="utf-8")
    controls = [{"group": "motors", "at": 0, "for": 1, "level": -1}]
    async with open_bench(str(level)) as (bench, _):
        told = {spec.name: spec.description for spec in bench.tools}
        assert '"controls"' in told["check"]
        assert "Uncontrol NUMBER" in told["edit"]
        assert "## Controls" in bench.brief_text
        machine = {"blocks": json.loads(CAR), "controls": controls}
        made = await bench.call("check", {"machine": machine})
        name = made.data["machine"]
        script = "Uncontrol 0\nControl 3, 4 at 0.2 for 0.8 level 1"
        edited = (await bench.call("edit", {"machine": name, "script": script})).data["machine"]
        shown = await bench.call("describe", {"machine": edited})
        assert "0. Control 3, 4 at 0.2 for 0.8 level 1" in shown.text
        assert shown.data["tree"]["controls"][0]["blocks"] == [3, 4]
        back, ahead = [
            (await bench.call("simulate", {"machine": each})).data["score"]
            for each in (name, edited)
        ]
        assert back < ahead


@pytest.mark.slow
async def test_agents_ask_what_controllers_read_and_gave() -> None:
    machine = Path("tests/machines/movement/stopping_car.json").read_text(encoding="utf-8")
    async with open_bench("movement/6", rollouts=12) as (bench, _):
        (spec,) = (spec for spec in bench.tools if spec.name == "query")
        assert '"controllers"' in spec.description
        item = spec.parameters["properties"]["queries"]["items"]["properties"]
        assert item["properties"] == {"type": "array", "items": {"type": "string"}, "maxItems": 8}
        name = (await bench.call("check", {"machine": machine})).data["machine"]
        await bench.call("simulate", {"machine": name})
        names = [*json.loads(machine)["controllers"]["laws"]]
        asked = [
            {"id": "controllers", "duration": [0, 2], "properties": properties}
            for properties in (names, [], ["position"])
        ]
        told = await bench.call("query", {"machine": name, "queries": asked})
        some, whole, refused = told.data["answers"]
        assert names[0] in some
        assert {*some} < {*whole}
        assert "known: " + names[0] in refused["problem"]


async def test_other_tasks_say_nothing_about_them() -> None:
    async with open_bench() as (bench, _):
        assert not any("ontrol" in spec.description for spec in bench.tools)
        machine = {"blocks": json.loads(CAR), "controls": [{"group": "motors"}]}
        assert (await bench.call("check", {"machine": machine})).refused
