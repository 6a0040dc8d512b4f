"""Statics as text: balance, what joints carry and what they hit, bending, thrust."""

from __future__ import annotations

from hypothesis import given

from agentflow.machine import Machine, place
from agentflow.machine.description.statics_text import statics_text
from agentflow.machine.geometry.balance import mass
from agentflow.machine.geometry.statics import tree_loads
from tests.machine.builders import CAR, CATAPULT, build
from tests.machine.strategies import valid_machines


def line_of(machine: Machine, block: int) -> str:
    """What is told about a joint, without the block that it belongs to."""
    (line,) = (li for li in statics_text(machine).splitlines() if li.startswith(f"{block} "))
    return line.partition(" carries ")[2]


def test_a_machine_without_joints_has_one_line() -> None:
    assert statics_text(build((1, 0, 0))) == (
        "Centre of mass (0.000,0.500,1.000), 0.500 m inside the edge of the support polygon."
    )


def test_wheels_that_carry_nothing_are_not_told() -> None:
    assert len(statics_text(CAR).splitlines()) == 1


def test_a_machine_that_tips_over_and_what_gravity_bends() -> None:
    """A log up, an arm of two logs from its foot to z+, ballast at the end."""
    machine = build((63, 0, 4), (63, 1, 10), (63, 2, 0), (35, 3, 0))
    assert statics_text(machine) == (
        "Centre of mass (0.000,1.620,4.480), 3.980 m OUTSIDE the edge of the support "
        "polygon.\n"
        "Greatest bending by gravity: 1 on 0 by 919 N m (6.00 kg), 2 on 1 by 837 N m (5.00 kg), 3 "
        "on 2 by 394 N m (4.00 kg)."
    )


def test_an_arm_with_a_boulder() -> None:
    """It stands upright: gravity does not turn it until it swings."""
    assert line_of(CATAPULT, 10) == (
        "11-13: 7.50 kg including itself, inertia 167.983 kg m2 about its axis, reach 6.476 m "
        "(12); gravity 0.000 N m, at most 1040 while it turns; motor, 13 to z-: 12 meets the "
        "ground "
        "after 99.4 degrees."
    )


def test_a_hinge_turns_both_ways_up_to_its_stops() -> None:
    """A log on a hinge on a mast, and a log that sticks out of the top of the mast."""
    machine = build((63, 0, 4), (5, 1, 0), (63, 2, 0), (63, 1, 12))
    assert line_of(machine, 2) == (
        "3: 1.50 kg including itself, inertia 7.292 kg m2 about its axis, reach 4.031 m (3); "
        "gravity 0.000 N m, at most 90 while it turns; 3 to z+: 3 meets 4 after 65.9 degrees; 3 "
        "to z-: "
        "free to 90 degrees."
    )


def test_what_only_turns_on_the_axis_has_no_direction() -> None:
    """A log on the axis of a rotating block, and one on the axis of a free joint."""
    machine = build((63, 0, 4), (22, 1, 0), (63, 2, 0))
    assert line_of(machine, 2).endswith("; gravity does not turn it; motor, one way: free.")
    machine = build((63, 0, 4), (40, 1, 0), (63, 2, 0))
    assert line_of(machine, 2).endswith("; gravity does not turn it; free both ways.")


def test_what_lies_on_the_ground_is_said() -> None:
    machine = build((5, 0, 0), (63, 1, 0))
    assert "; partly on the ground; " in line_of(machine, 1)
    assert "bends" not in statics_text(machine)


def test_a_joint_in_a_loop_is_not_told() -> None:
    """A brace beside a rotating block."""
    tied = build((63, 0, 4), (22, 1, 0), (63, 2, 0), (7, 1, 5, 3, 5))
    assert 2 not in {load.bond.block for load in tree_loads(place(tied))}
    assert "Rotating Block" not in statics_text(tied)
    free = build((63, 0, 4), (22, 1, 0), (63, 2, 0), (9, 1, 5, 3, 5))
    assert line_of(free, 2).startswith("3-4: 2.20 kg including itself")


def test_thrust_beside_the_centre_of_mass() -> None:
    machine = build((14, 0, 4), (35, 0, 3))
    assert statics_text(machine).splitlines()[-1] == (
        "Thrust (0,100,0) N, weight 123 N; the thrust's moment about the centre of mass is "
        "(0,0,-80) N m, so its line passes 0.800 m from it."
    )


@given(valid_machines())
def test_every_connection_that_is_told_separates_the_machine(machine: Machine) -> None:
    geometry = place(machine)
    for load in tree_loads(geometry):
        assert load.bond.block in load.blocks
        assert 0 not in load.blocks
        assert 0 < load.mass < mass(geometry)
        assert load.inertia >= 0
        assert load.most_turning >= abs(load.turning) - 1e-9
    assert statics_text(machine).startswith("Centre of mass (")
