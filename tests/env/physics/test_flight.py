"""Flying blocks and propellers against their laws."""

from __future__ import annotations

from math import cos, radians, sin

import numpy as np
import pytest

from agentflow.env.constants import constants
from agentflow.env.physics.assembly import assemble
from agentflow.env.physics.engine import Engine
from agentflow.env.physics.frames import swap, swap_quaternion, swap_turn
from agentflow.env.physics.laws.forces import PartLocations
from agentflow.env.physics.laws.motion import MotionForce
from agentflow.env.rotations import rotate
from agentflow.env.scene import Scene
from agentflow.machine.blocks.library import library
from agentflow.machine.geometry.placement import place
from tests.env.conftest import MakeEngine
from tests.env.machines import machine
from tests.env.physics.rig import FACINGS, HEIGHT, RATE, Rig

ROOT = (0, -1, -1)
FLYING, LONG_BLADE, SHORT_BLADE = 14, 26, 55


@pytest.mark.parametrize("face", range(6), ids=FACINGS)
def test_a_flying_block_pushes_along_its_front(calm: Engine, face: int) -> None:
    rig = Rig(calm, machine(ROOT, (FLYING, 0, face)), anchored=False)
    rig.world.step()
    assert rig.world.speeds() == (0.0, 0.0)
    front = np.array(rig.blocks[1].front)
    mass = sum(part.mass for part in rig.assembly.parts)
    for level, speed in ((1, 100.0 / mass / RATE), (-1, 0.0), (-0.5, -50.0 / mass / RATE)):
        rig.world.switch("motors", level)
        rig.world.step()
        found = rig.world.state().velocity[0]
        assert found == pytest.approx(speed * front, rel=1e-2, abs=6e-3)
    assert library()[FLYING].thrust == 100.0


def test_a_flying_block_off_the_middle_turns_its_machine(calm: Engine) -> None:
    """100 N at 1 m from the heavy root: torque over moment of inertia."""
    rig = Rig(calm, machine(ROOT, (15, 0, 2), (FLYING, 1, 3)), anchored=False)
    front = np.array(rig.blocks[2].front)
    rig.world.switch("motors", 1)
    rig.world.step()
    momentum = rig.world.momentum()
    high = (0.0, HEIGHT, 0.0)
    arm = rig.rest.centre[2] - high
    assert momentum["linear"] == pytest.approx(100.0 / RATE * front, rel=1e-2, abs=2e-3)
    spin = momentum["angular"] - np.cross(high, momentum["linear"])
    assert spin == pytest.approx(np.cross(arm, 100.0 / RATE * front), rel=1e-2, abs=2e-3)


@pytest.mark.parametrize("kind", [LONG_BLADE, SHORT_BLADE])
@pytest.mark.parametrize("face", range(6), ids=FACINGS)
def test_blades_follow_the_law_of_the_reference(kind: int, face: int) -> None:
    """In the game frame: -0.015 (v . n) min(v^2, 30^2) along Up, n Up turned about Front."""
    tree = machine(ROOT, (kind, 0, face))
    block, blade = place(tree).blocks[1], library()[kind].blade
    assert blade is not None
    assert (blade.axial_drag, blade.speed_cap) == (0.015, 30.0)
    assembly = assemble(tree, place(tree), constants())
    (lift,) = assembly.devices.moved
    rng = np.random.default_rng(3)
    for scale in (1.0, 8.0, 40.0):
        velocity, spin, offset = rng.normal(size=(3, 3))
        velocity *= scale
        turn = rng.normal(size=4)
        turn /= np.linalg.norm(turn)
        locations = PartLocations(np.array([0, 0]), np.array([[0, 0, 0], swap(offset)]))
        row = (0, 0, 0, *swap_quaternion(turn), *swap(velocity), *swap_turn(spin))
        ((part, push, at),) = MotionForce((lift,), locations)([row])
        up, right = np.array(block.up), np.array(block.right)
        angle = radians(blade.lift_angle_deg)
        normal = rotate(turn, cos(angle) * up - sin(angle) * right)
        through = velocity + np.cross(spin, rotate(turn, offset))
        size = -0.015 * (through @ normal) * min(through @ through, 900.0)
        assert (part, at) == (1, None)  # at its own centre, in its own axes
        assert swap(push) == pytest.approx(size * up)


@pytest.mark.parametrize(
    ("kind", "face", "sense"), [(26, 4, 1), (26, 5, -1), (55, 4, 1), (55, 5, -1)]
)
def test_a_rotor_lifts_as_its_blades_say(calm: Engine, kind: int, face: int, sense: int) -> None:
    """Four blades round a rotating block, on a suspension that tells their force.

    A rotor that faces up turns clockwise seen from above, which drives blades to their Right.
    """
    tree = machine(ROOT, (16, 0, face), (22, 1, 0), *((kind, 2, side) for side in (1, 2, 3, 4)))
    rig = Rig(calm, tree)
    rig.world.switch("motors", 1)
    rig.run(4.0)
    block, speed = library()[kind], constants().of("motor_speed", 22)
    assert block.size is not None
    assert block.blade is not None
    through = speed * (0.5 + block.size[2] / 2)
    push = 4 * 0.015 * sin(radians(block.blade.lift_angle_deg)) * through**3
    lifted = rig.moved(2)[1]
    assert lifted == pytest.approx(sense * push / constants()["suspension_stiffness"], rel=0.01)


def test_a_machine_with_enough_thrust_climbs(make_engine: MakeEngine) -> None:
    """100 N on 0.75 kg: it takes off at thrust over mass less gravity, less its drag."""
    engine = make_engine()
    tree = machine(ROOT, (FLYING, 0, 4))
    world = engine.build(assemble(tree, place(tree), constants()), Scene(), RATE)
    for _ in range(60):
        world.step()
    low = world.centre(0)[1]
    world.switch("motors", 1)
    speed = height = 0.0
    drag = (0.25 * 0.2 + 0.5 * 0.5) / 0.75
    for _ in range(60):
        world.step()
        speed += (100.0 / 0.75 - 32.81 - drag * speed) / RATE
        height += speed / RATE
    assert world.centre(0)[1] - low == pytest.approx(height, rel=0.01)
