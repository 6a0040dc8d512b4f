"""What a design must not do before it begins."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest

from agentflow.errors import UsageError
from agentflow.studio.folder import RunFolder
from agentflow.studio.watching import designs
from agentflow.studio.watching.designs import MOST, Designs, NewDesign, require_possible

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
