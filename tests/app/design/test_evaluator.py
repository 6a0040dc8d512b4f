"""Pictures of machines by the evaluator, and what it tells histories."""

from __future__ import annotations

import asyncio
import base64
import io
import re

import pytest
from PIL import Image

from agentflow.app.design.evaluator import PICTURE, PhysicsEvaluator, decisive_facts
from agentflow.env.pool.pool import RolloutPool
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.registry import get_task
from agentflow.machine.tree import ROOT, Machine, Step
from tests.env.machines import PRINTED


def test_facts_for_histories_tell_release_and_first_break() -> None:
    """The published catapult throws its boulder and loses blocks."""
    rollout = simulate(PRINTED, get_task("throwing"))
    facts = decisive_facts(PRINTED, rollout)
    assert list(facts) == ["release", "first break"]
    assert re.fullmatch(r"\d+\.\d m/s at -?\d+ degrees", facts["release"])
    first = rollout.broken[0]
    assert all(first.time <= item.time for item in rollout.broken)
    assert facts["first break"].endswith(f" at {first.time:.2f} s")
    assert " off " in facts["first break"]
    assert not re.search(r"block", facts["first break"])
    still = Machine((ROOT, Step(1, 63, 0, 4)))
    assert decisive_facts(still, simulate(still, get_task("movement"))) == {}


@pytest.mark.slow
async def test_views_are_drawn_once() -> None:
    task = get_task("movement")
    pool = RolloutPool(1)  # never started: drawing needs no worker
    evaluator = PhysicsEvaluator(task, pool, seed=0)
    machine = Machine((ROOT, Step(1, 63, 0, 4)))
    before = len(asyncio.all_tasks())
    (url,) = await evaluator.views(machine)
    again = asyncio.ensure_future(evaluator.views(machine))
    await asyncio.sleep(0)
    assert len(asyncio.all_tasks()) <= before + 1, "it is drawn again"
    assert await again == (url,)
    fresh = PhysicsEvaluator(task, pool, seed=1)
    assert await fresh.views(machine) == (url,)
    data = base64.b64decode(url.removeprefix("data:image/png;base64,"))
    assert Image.open(io.BytesIO(data)).format == "PNG"
    assert Image.open(io.BytesIO(data)).width <= PICTURE[0] * 2
