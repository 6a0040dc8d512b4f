"""What the MuJoCo engine works around."""

from __future__ import annotations

from math import cos, sin, sqrt
from pathlib import Path

import numpy as np
import pytest

from agentflow.env.constants import Constants, constants
from agentflow.env.physics.laws.flight import Thruster
from agentflow.env.physics.model import Devices, Drive, Part
from agentflow.env.physics.mujoco.engine import MuJoCoEngine
from agentflow.env.physics.mujoco.world import MuJoCoWorld
from agentflow.env.scene import Scene, SceneObject
from tests.env.physics.rig import weightless
from tests.env.physics.test_contract import BALL, CUBE, RATE, arm, cube, machine, run


def build(scene: Scene, *parts: Part, physics: Constants | None = None) -> MuJoCoWorld:
    return MuJoCoEngine(physics).build(machine(list(parts), []), scene, RATE)


@pytest.mark.parametrize("speed", [4.0, -9.0])
@pytest.mark.parametrize("divisions", [1, 4])
def test_a_motor_gives_its_torque_up_to_its_speed_and_no_more(speed: float, divisions: int) -> None:
    """No interface of MuJoCo promises that constraints may be changed between two half steps."""
    drive = Drive(speed=speed, torque=50.0)
    world = MuJoCoEngine(weightless()).build(arm(drive=drive), Scene(), RATE)
    world.switch("motors", 1.0)
    moment = 1.0 + 2.0 / 6.0 + 2.0 * 1.5**2
    for step in range(1, 60 * divisions):
        world.step(divisions)
        free = 50.0 / moment * step / (RATE * divisions)
        spin = float(world.state().angular_velocity[1, 1])
        assert spin == pytest.approx(np.copysign(min(free, abs(speed)), speed), rel=2e-3)
    works = world.works()
    assert (np.diff(works[:, 1]) * RATE * divisions <= 50.0 * abs(speed) * (1 + 1e-9)).all()
    assert works[-1, 1] == pytest.approx(moment / 2 * spin**2, rel=5e-3)


@pytest.mark.parametrize("turn", [0.0, 0.3, 1.9, 4.4])
def test_an_upright_cylinder_stands_on_the_ground(turn: float) -> None:
    """MuJoCo finds contacts radii deep for some turns if its axis is exactly upright."""
    drum = SceneObject("drum", "cylinder", (3.0, 1.0, 3.0), (5.0, 0.5, 0.0), mass=50.0)
    drum = SceneObject(**(vars(drum) | {"rotation": (0.0, sin(turn / 2), 0.0, cos(turn / 2))}))
    world = build(Scene((drum,)), cube(0, (0.0, 0.5, 0.0)))
    for _ in range(120):
        world.step()
        assert world.centre("drum")[1] == pytest.approx(0.5, abs=0.02)
        assert max(world.speeds()) < 1.0


@pytest.mark.parametrize(
    ("one", "other"), [(0.8, 0.8), (1.0, 0.8), (0.1, 0.8), (1.0, 1.0), (1.0, 0.1), (0.1, 0.2)]
)
def test_friction_is_the_geometric_mean_of_any_two_surfaces(one: float, other: float) -> None:
    part = Part(0, (0.0, 0.49, 0.0), 2.0, (0.3,) * 3, (CUBE,), friction=one, restitution=0.18)
    world = build(Scene(friction=other), part)
    run(world, 20)
    contact = world.now.built.data.contact
    assert len(contact.dist) == 4
    assert contact.friction[:, :2] == pytest.approx(sqrt(one * other))


def test_what_rests_on_a_lively_surface_comes_to_rest() -> None:
    part = Part(0, (0.0, 1.0, 0.0), 2.0, (0.3,) * 3, (CUBE,), friction=0.8, restitution=0.9)
    world = build(Scene(), part)
    run(world, 240)
    assert max(world.speeds()) < constants()["rest_speed"]


def test_a_simulation_that_diverges_writes_no_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    push = Devices(thrusters=(Thruster(0, (0.0, 1e200, 0.0)),))
    assembly = machine([cube(0, (0.0, 5.0, 0.0))], [], devices=push)
    world = MuJoCoEngine().build(assembly, Scene((BALL,)), RATE)
    world.switch("motors", 1.0)
    run(world, 5)
    assert not world.speeds()[0] <= constants()["speed_limit"]
    assert not list(tmp_path.iterdir())
