"""What a design must not do before it begins."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest

from agentflow.app.design.config import config_json, load_config
from agentflow.app.design.plan import RunPlan
from agentflow.errors import UsageError
from agentflow.studio.folder import RunFolder
from agentflow.studio.watching import designs
from agentflow.studio.watching.designs import MOST, Designs, NewDesign, form_of, require_possible
from tests.machine.builders import CAR

AWAY = NewDesign(task="movement", model="gpt", base_url="https://models.example.org/v1")


def test_a_key_goes_only_to_hosts_that_were_named_elsewhere(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delenv("OPENAI_BASE_URL", raising=False)
    monkeypatch.delenv("OPENAI_API_KEY", raising=False)
    require_possible(AWAY)
    monkeypatch.setenv("OPENAI_API_KEY", "sk-secret")
    with pytest.raises(UsageError, match="to a host that you have named only here: https://models"):
        require_possible(AWAY)
    require_possible(AWAY.model_copy(update={"base_url": "http://127.0.0.1:8000/v1"}))
    monkeypatch.setenv("OPENAI_BASE_URL", AWAY.base_url)
    require_possible(AWAY)


def test_the_form_takes_what_it_can_from_a_run_and_names_the_rest() -> None:
    asked = {
        "task": "movement",
        "workflow": "single",
        "seed": 4,
        "settings.trajectories": 3,
        "model.name": "gpt",
        "model.base_url": "http://127.0.0.1:8000/v1",
        "search.rounds": 2,
        "model.budget.calls": 9,
        "settings.start": CAR.to_json(),
    }
    others = {"search.width": 7, "knobs.blocks.max": 31, "model.budget.money": 2.0}
    prices = {"model.prices.gpt.input": 1.0, "model.prices.gpt.output": 2.0}
    config = RunPlan.of(load_config(None, (), {**asked, **others, **prices})).config
    found = form_of({"config": config_json(config)})
    form = NewDesign.model_validate(found["form"])
    assert form.seed == 5
    assert form.machine == CAR.to_json()
    given = {key.removeprefix("settings."): value for key, value in asked.items()}
    del given["start"]
    assert form.options == {**given, "seed": 5}
    assert found["left"] == {**others, **prices}


@pytest.mark.parametrize(
    ("key", "value", "field"),
    [
        ("task", "mine.yaml", "task"),
        ("workflow", "external", "workflow"),
        ("model.name", "./folder", "model"),
        ("settings.trajectories", 65, "trajectories"),
        ("seed", 2**31 - 1, "seed"),
    ],
)
def test_what_the_form_refuses_is_left_out(key: str, value: object, field: str) -> None:
    config = config_json(load_config(None, (), {}))
    *groups, last = key.split(".")
    inner = config
    for group in groups:
        inner = inner[group]
    inner[last] = value
    found = form_of({"config": config})
    assert field not in found["form"]
    assert key.removeprefix("settings.") in found["left"]


async def test_designs_that_begin_together_count_before_they_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun = asyncio.Event()

    async def wait(*_: Any) -> None:
        await begun.wait()
        raise UsageError("ended")

    monkeypatch.setattr(designs.asyncio, "to_thread", wait)
    many = Designs(RunFolder(tmp_path), tmp_path)
    started = [asyncio.ensure_future(many.start(AWAY)) for _ in range(MOST + 2)]
    await asyncio.sleep(0)
    begun.set()
    said = [str(error) for error in await asyncio.gather(*started, return_exceptions=True)]
    assert said == ["ended"] * MOST + [f"{MOST} designs are running; stop one of them"] * 2
    with pytest.raises(UsageError, match="ended"):
        await many.start(AWAY)
