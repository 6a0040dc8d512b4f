"""Pictures of machines by the laboratory."""

from __future__ import annotations

import asyncio
import base64
import io

import pytest
from PIL import Image

from agentflow.app.design.laboratory import PICTURE, PhysicsLaboratory
from agentflow.env.pool.pool import RolloutPool
from agentflow.env.tasks.registry import get_task
from agentflow.machine.tree import ROOT, Machine, Step


@pytest.mark.slow
async def test_views_are_drawn_once() -> None:
    task = get_task("movement")
    pool = RolloutPool(1)  # never started: drawing needs no worker
    laboratory = PhysicsLaboratory(task, pool, seed=0)
    machine = Machine((ROOT, Step(1, 63, 0, 4)))
    before = len(asyncio.all_tasks())
    (url,) = await laboratory.views(machine)
    again = asyncio.ensure_future(laboratory.views(machine))
    await asyncio.sleep(0)
    assert len(asyncio.all_tasks()) <= before + 1, "it is drawn again"
    assert await again == (url,)
    fresh = PhysicsLaboratory(task, pool, seed=1)
    assert await fresh.views(machine) == (url,)
    data = base64.b64decode(url.removeprefix("data:image/png;base64,"))
    assert Image.open(io.BytesIO(data)).format == "PNG"
    assert Image.open(io.BytesIO(data)).width <= PICTURE[0] * 2
