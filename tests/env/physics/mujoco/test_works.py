"""The work that a world tells of, against that of all forces in MuJoCo's own coordinates."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
import pytest

from agentflow.env.constants import constants
from agentflow.env.physics.assembly import assemble
from agentflow.env.physics.loads import Loads
from agentflow.env.physics.mujoco import world as module
from agentflow.env.physics.mujoco.engine import MuJoCoEngine
from agentflow.env.tasks.registry import get_task
from agentflow.machine.geometry.placement import place
from benchmarks.shelf import load
from tests.env.physics.mujoco.works import Works

RATE = constants()["step_rate"]


@pytest.mark.parametrize(
    ("name", "task", "breaks"),
    [
        ("published_throw.json", "throwing", True),
        ("throwing/spring_arm.json", "throwing", False),
        ("flying/copter.json", "flying", False),
        ("lifting/strong_drawbridge.json", "lifting", False),
        ("sprung_car.json", "movement", False),
    ],
)
def test_all_work_that_is_told_adds_up(
    monkeypatch: pytest.MonkeyPatch, name: str, task: str, breaks: bool
) -> None:
    """Less than 0.25 % of the work differs: of each source by itself where MuJoCo knows it."""
    machine, level = load(name), get_task(task, engine="mujoco").trials(0)[0]
    found = Works()
    assembly = assemble(machine, place(machine), constants())
    world = MuJoCoEngine().build(assembly, level.scene(machine), RATE)
    loads = Loads(assembly.joints, constants()["load_window"], 1.0 / RATE)
    for _ in range(60):
        world.step()
        loads.update(world.reactions)
    start, first = world.energies(world.snapshot()), world.works()[-1]
    joints = world._works_of_joints[0].sum()
    monkeypatch.setattr(module, "mujoco", found)
    broken: list[int] = []
    due = level.switches(machine)
    for step in range(240):
        for time, entry, on in due:
            if round(time * RATE) == step:
                world.switch(entry, on)
        world.step()
        new = list(loads.update(world.reactions))
        if new:
            world.split(new)
        broken += new
    assert broken or not breaks
    told = (world.works()[-1] - first).sum()
    gained = (world.energies(world.snapshot()) - start).sum()
    own = told - (world._works_of_joints[0].sum() - joints)
    assert found.turnover > 50.0
    most = 0.0025 * found.turnover
    assert own == pytest.approx(found.outside, abs=most)
    assert own + found.inside + found.steps == pytest.approx(gained, abs=most)


def test_contacts_are_where_the_engine_stores_them(monkeypatch: pytest.MonkeyPatch) -> None:
    """They are copied from its memory, whose address no interface promises to stay the same while
    contacts come and go, and in the next model."""
    seen: list[tuple[list[list[int]], list[list[float]]]] = []

    def step1(model: Any, data: Any) -> None:
        seen.append((data.contact.geom.tolist(), data.contact.pos.tolist()))
        mujoco.mj_step1(model, data)

    machine, level = load("rotor_of_rods.json"), get_task("movement", engine="mujoco")
    assembly = assemble(machine, place(machine), constants())
    world = MuJoCoEngine().build(assembly, level.scene(machine), RATE)
    monkeypatch.setattr(module, "mujoco", SimpleNamespace(mj_step1=step1, mj_step2=mujoco.mj_step2))
    world.switch("motors", 1.0)
    counts = set()
    for step in range(240):
        if step == 120:
            world.split([0])
        world.step()
        geoms, places = seen[-1]
        shapes, _, found = world.now.contacts._look()
        counts.add(len(found))
        assert shapes.tolist() == geoms
        assert found.copy().view(np.float64).tolist() == places
    assert len(counts) > 3
