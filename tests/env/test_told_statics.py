"""What models are told about a machine at rest, against the engine."""

from __future__ import annotations

from math import degrees, sqrt

import pytest

from agentflow.env.constants import constants
from agentflow.env.physics.assembly import assemble
from agentflow.env.physics.assembly.parts import HINGE_PLATE as SIMULATED_PLATE
from agentflow.env.physics.engine import Engine
from agentflow.env.scene import Scene
from agentflow.machine.geometry import statics, sweeps
from agentflow.machine.geometry.placement import place
from agentflow.machine.geometry.statics import Load, tree_loads
from agentflow.machine.geometry.sweeps import first_collision
from agentflow.machine.geometry.vectors import length
from agentflow.machine.tree import Machine
from tests.env.conftest import MakeEngine
from tests.env.machines import machine
from tests.env.physics.rig import RATE, Rig, raised, weightless
from tests.env.test_statics import FOOT, force, loads, stand, torque

MAST = (*FOOT, (63, 0, 4), (63, 5, 0))
ARM = machine(*MAST, (22, 6, 6), (63, 7, 0), (63, 8, 3), (35, 9, 0), (9, 8, 7, 9, 8))
"""A rotating block on a mast with a bent arm that sticks out."""


def load_of(tree: Machine, block: int) -> Load:
    return next(load for load in tree_loads(place(tree)) if load.bond.block == block)


def test_the_numbers_are_those_of_the_simulation() -> None:
    physics = constants()
    assert physics["gravity"] == statics.GRAVITY
    assert (physics["shrink"], SIMULATED_PLATE) == (sweeps.SHRINK, sweeps.HINGE_PLATE)


def test_held_joints_bear_the_moment_that_is_told(engine: Engine) -> None:
    """The part about the axis of a rotating block is borne by its motor."""
    found = loads(*stand(engine, ARM))
    for load in tree_loads(place(ARM)):
        if load.bond.block in (7, 8, 9, 10):
            bears = found[load.bond.block, ARM[load.bond.block].parent]
            motor = load.turning if load.bond.kind == "revolute" else 0.0
            moment = sqrt(length(load.gravity) ** 2 - motor**2)
            assert force(bears) == pytest.approx(load.mass * statics.GRAVITY, rel=0.01)
            assert torque(bears) == pytest.approx(moment, rel=0.01)
    assert load_of(ARM, 7).mass == pytest.approx(6.4)


@pytest.mark.parametrize(("share", "holds"), [(0.97, False), (1.03, True)])
def test_a_motor_holds_the_moment_that_is_told(
    share: float, holds: bool, make_engine: MakeEngine
) -> None:
    load = load_of(ARM, 7)
    weak = constants().changed({"motor_torque.22": share * abs(load.turning)})
    world = make_engine(weak).build(assemble(ARM, place(ARM), weak), Scene(), RATE)
    heights = []
    for _ in range(round(1.5 * RATE)):
        world.step()
        heights.append(world.centre(load.farthest)[1])
    assert (heights[-60] - heights[-1] < 0.001) is holds


RAISED = ((0, -1, -1), (63, 0, 5), (63, 1, 0))
"""A root on two logs, 6 m above the ground."""


def test_a_motor_speeds_up_what_it_carries_as_its_inertia_says(make_engine: MakeEngine) -> None:
    tree = machine((0, -1, -1), (22, 0, 3), (63, 1, 1), (63, 2, 0), (35, 3, 0), (50, 4, 1))
    load = load_of(tree, 1)
    rig = Rig(make_engine(weightless()), tree)
    rig.world.switch("motors", 1)
    rig.run(1 / RATE)
    spin = rig.spin(2, load.bond.axis)
    assert spin == pytest.approx(constants().of("motor_torque", 22) / load.inertia / RATE, rel=0.02)


OBSTACLES = {
    "box": machine(*RAISED, (22, 0, 3), (63, 3, 2), (63, 0, 4), (15, 5, 5)),
    "ball": machine(
        *RAISED, (22, 0, 3), (63, 3, 2), (30, 4, 0), (36, 5, 0), (63, 0, 4), (15, 7, 6)
    ),
    "wheel": machine(*RAISED, (22, 0, 3), (63, 3, 1), (40, 4, 3), (63, 0, 1), (63, 6, 6)),
}


def turned_until_contact(
    tree: Machine, load: Load, make_engine: MakeEngine
) -> tuple[float, set[int]]:
    """Angle in degrees, and the blocks in contact, when a slow motor is first stopped."""
    slow = weightless().changed({"motor_speed.22": 0.4, "motor_torque.22": 5000.0})
    assembly = raised(assemble(tree, place(tree), slow))
    rig = Rig(make_engine(slow), tree, assembly=assembly)
    rig.world.switch("motors", 1)
    rest = set(range(len(tree))) - load.blocks
    for _ in range(round(16 * RATE)):
        rig.world.step()
        touched = {
            pair
            for pair in load.blocks
            for other in rig.world.touching(pair)
            if other in rest and {pair, other} != {load.bond.block, tree[load.bond.block].parent}
        }
        if touched:
            return degrees(rig.angle(4, load.bond.axis)) % 360.0, touched
    return 360.0, set()


@pytest.mark.parametrize("name", OBSTACLES)
def test_a_slow_turn_ends_at_the_collision_that_is_told(name: str, make_engine: MakeEngine) -> None:
    tree = OBSTACLES[name]
    load = load_of(tree, 3)
    told = first_collision(place(tree), load, 1, 360.0)
    assert told is not None
    angle, touched = turned_until_contact(tree, load, make_engine)
    assert told.block in touched
    assert angle == pytest.approx(told.angle, abs=1.0)


def test_an_arm_meets_the_ground_where_it_is_told(make_engine: MakeEngine) -> None:
    tree = machine(*FOOT, (63, 0, 4), (22, 5, 6), (63, 6, 1), (63, 7, 0))
    load = load_of(tree, 6)
    told = first_collision(place(tree), load, 1, 360.0)
    assert told is not None
    assert told.other is None
    slow = constants().changed({"motor_speed.22": 0.4})
    world = make_engine(slow).build(assemble(tree, place(tree), slow), Scene(), RATE)
    for _ in range(60):
        world.step()
    world.switch("motors", 1)
    steps = 0
    while not any("ground" in world.touching(block) for block in load.blocks):
        world.step()
        steps += 1
        assert steps < 10 * RATE
    assert degrees(0.4 * steps / RATE) == pytest.approx(told.angle, abs=2.0)
    assert told.angle > 20.0
