"""Water cannons and torches on a stand: recoil, and steam where a flame heats a cannon.

The figures are those of the game's wiki, as quoted by the public block configurations of
BuildArena: a recoil of 1.6 units of mass at normal gravity, 8.6 times that as steam; the flame is a
ball of radius 0.3 m, 1 m from the middle of the torch.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from agentflow.env.constants import constants
from agentflow.env.physics.engine import Engine
from agentflow.machine.blocks.library import TORCH, WATER_CANNON, library
from agentflow.machine.geometry.placement import place
from agentflow.machine.geometry.statics import thrust
from agentflow.machine.tree import Machine
from tests.env.machines import machine
from tests.env.physics.rig import FACINGS, RATE, Rig

ROOT = (0, -1, -1)
RECOIL = 1.6 * constants()["gravity"]
ENGINE = machine(ROOT, (15, 0, 3), (15, 1, 2), (15, 2, 3), (WATER_CANNON, 3, 1), (TORCH, 0, 4))
"""A cannon beside three cubes; the torch on the root heats it from the side."""


def push_of(rig: Rig) -> np.ndarray:
    """Force on the whole machine while motors are on, N: its momentum after one step."""
    rig.world.switch("motors", 1)
    rig.world.step()
    return np.asarray(rig.world.momentum()["linear"]) * RATE


@pytest.mark.parametrize("face", range(6), ids=FACINGS)
def test_a_water_cannon_pushes_to_its_up(calm: Engine, face: int) -> None:
    rig = Rig(calm, machine(ROOT, (WATER_CANNON, 0, face)), anchored=False)
    rig.world.step()
    assert rig.world.speeds() == (0.0, 0.0)
    up = np.array(rig.blocks[1].up)
    assert push_of(rig) == pytest.approx(RECOIL * up, rel=1e-2, abs=0.6)


def test_in_a_flame_it_pushes_8_6_times_as_much(calm: Engine) -> None:
    blocks = place(ENGINE).blocks
    flame = np.add(blocks[5].center, blocks[5].up)
    assert np.linalg.norm(flame - blocks[4].center) < 0.3
    found = push_of(Rig(calm, ENGINE, anchored=False))
    assert found == pytest.approx([0.0, 8.6 * RECOIL, 0.0], rel=1e-2, abs=5.0)
    force, _ = thrust(place(ENGINE))
    assert force == pytest.approx((0.0, 8.6 * RECOIL, 0.0), rel=1e-3)


def test_a_torch_elsewhere_changes_nothing(calm: Engine) -> None:
    cold = Machine((*ENGINE.steps[:-1], replace(ENGINE[5], face_id=5)))
    assert push_of(Rig(calm, cold, anchored=False)) == pytest.approx(
        [0.0, RECOIL, 0.0], rel=1e-2, abs=0.6
    )
    assert thrust(place(cold))[0] == pytest.approx((0.0, RECOIL, 0.0), rel=1e-3)


def test_masses_and_flame_are_those_of_the_wiki() -> None:
    cannon, torch = library()[WATER_CANNON], library()[TORCH]
    assert (cannon.mass, cannon.thrust, cannon.steam) == (1.5, pytest.approx(RECOIL), 8.6)
    assert torch.flame is not None
    assert (torch.mass, torch.flame.reach, torch.flame.radius) == (1.0, 1.0, 0.3)
    assert cannon.group == "thrusters"
    assert torch.group is None
