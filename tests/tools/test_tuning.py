"""The tool that tunes: what it costs, what it finds, where it is on offer."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.app.design.test_controls import LEVEL
from tests.app.design.test_tune import BLOCKS, START
from tests.tools.benches import open_bench


@pytest.mark.slow
async def test_tuning_is_charged_and_its_machine_has_a_name(tmp_path: Path) -> None:
    pytest.importorskip("cma")
    level = tmp_path / "designed.yaml"
    level.write_text(LEVEL, encoding="utf-8")
    async with open_bench(str(level), rollouts=8) as (bench, record):
        name = (await bench.call("check", {"machine": START.to_text()})).data["machine"]
        refused = await bench.call("tune", {"machine": name, "simulations": 9})
        assert refused.text == "this takes 9 simulations, and 8 are left"
        told = await bench.call("tune", {"machine": name, "simulations": 6})
        assert "2 of 8 simulations left" in bench.budget_text
        assert told.data["simulations"] == 6
        assert told.data["score"] > told.data["before"]
        assert told.text.startswith(f"Machine {told.data['machine']}: score ")
        assert told.data["changes"]
        again = await bench.call("simulate", {"machine": told.data["machine"]})
        assert again.data["known"]
        assert again.data["score"] == told.data["score"]
        bare = (await bench.call("check", {"machine": BLOCKS.to_text()})).data["machine"]
        refused = await bench.call("tune", {"machine": bare, "simulations": 2})
        assert refused.text.startswith("this machine brings no controls")
    labels = [label for kind, label in record.events if kind == "evaluation"]
    assert sum("call-3" in label for label in labels) == 6


async def test_tuning_is_on_offer_only_where_machines_bring_controls() -> None:
    async with open_bench() as (bench, _):
        assert "tune" not in {tool.name for tool in bench.tools}
        told = await bench.call("tune", {"machine": "x"})
        assert told.text.startswith("the tool 'tune' is not on offer in this stage")
