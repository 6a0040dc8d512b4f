"""The shared parts of feedback: thinning, orientation, loads, stalls, length."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agentflow.env.feedback.compose import compose
from agentflow.env.feedback.separation import describe_release
from agentflow.env.feedback.stalls import stall_lines, stalled_motors
from agentflow.env.feedback.text import (
    MAX_SAMPLES,
    number,
    orientation_runs,
    sample_indices,
    series,
    settled_lines,
)
from agentflow.env.rollout import Moment, RolloutEvent, Verdict
from agentflow.env.tasks.base import Schedule
from agentflow.machine.tree import ROOT, Machine, Step
from tests.env.fakes import make_trace

HALF = 0.5**0.5
WHEELED = Machine((ROOT, Step(1, 2, 0, 2), Step(2, 22, 0, 0), Step(3, 15, 2, 0)))


@given(st.integers(1, 3000))
def test_a_series_has_at_most_11_samples_and_starts_at_the_first(count: int) -> None:
    picks = list(sample_indices(count))
    assert 1 <= len(picks) <= MAX_SAMPLES
    assert picks[0] == 0
    assert count - 1 - picks[-1] < max(1, picks[1] if len(picks) > 1 else 1)


def test_a_fine_record_is_thinned_to_half_a_second() -> None:
    times = np.arange(601) / 120
    assert series("x", times, np.zeros((601, 3))).times == pytest.approx(np.arange(11) * 0.5)


def test_numbers_lose_the_sign_of_zero() -> None:
    assert (number(-0.001), number(-0.006), number(1234.5)) == ("0.00", "-0.01", "1234.50")


def test_orientation_names_the_front_and_a_top_that_is_not_up() -> None:
    rotation = np.tile((0.0, 0.0, 0.0, 1.0), (4, 1, 1))
    rotation[2] = (0.0, HALF, 0.0, HALF)  # facing x+
    rotation[3] = (-HALF, 0.0, 0.0, HALF)  # facing y+, its Up is z-
    assert orientation_runs(make_trace(1, 4, rotation=rotation)) == [
        ("z+", 0.0, pytest.approx(0.2)),
        ("x+", pytest.approx(0.4), pytest.approx(0.4)),
        ("y+ with its top towards z-", pytest.approx(0.6), pytest.approx(0.6)),
    ]


def test_a_tumbling_root_gets_its_commonest_orientations() -> None:
    rotation = np.tile((0.0, 0.0, 0.0, 1.0), (20, 1, 1))
    rotation[1::2] = (0.0, HALF, 0.0, HALF)
    trace = make_trace(1, 20, rotation=rotation)
    text = compose(Machine((ROOT,)), trace, (), Verdict(0.0, {}), "m", (), {}, ()).text
    assert ("Orientation of block 0: changes 19 times, facing z+ 50% of the time; x+ 50%") in text


def test_the_angle_at_which_an_arm_has_settled_is_told() -> None:
    arm = Machine((ROOT, Step(1, 5, 0, 0), Step(2, 63, 1, 0), Step(3, 2, 0, 2)))
    tilt = np.radians(20.0) / 2
    rotation = np.tile((0.0, 0.0, 0.0, 1.0), (4, 4, 1))
    rotation[:, 1:3] = (np.sin(tilt), 0.0, 0.0, np.cos(tilt))
    rotation[:, 3] = (0.0, -HALF, 0.0, HALF)
    down = make_trace(4, 4, rotation=rotation)
    assert settled_lines(arm, down) == [
        "Joints at t = 0: block 1 (Hinge) has swung 20 degrees, its Front 20 degrees below level"
    ]
    text = compose(arm, down, (), Verdict(0.0, {}), "m", (), {}, ()).text
    assert settled_lines(arm, down)[0] in text
    rotation[:, 1:3] = (0.0, 0.0, 0.0, 1.0)
    assert settled_lines(arm, make_trace(4, 4, rotation=rotation)) == []


def test_springs_are_told_with_their_lengths_at_the_start_and_now() -> None:
    """Their law gives the work of each; those that shortened alike share an item."""
    tied = Machine((ROOT, Step(1, 63, 0, 0), *(Step(n, 9, 0, n, 1, 1) for n in (2, 3, 4))))
    length = np.array([[3.0, 3.0, 2.5], [3.0, 3.0, 2.5], [1.2, 1.2, 1.0]])
    trace = make_trace(5, 3, length=length, linear=(2, 3, 4))
    (line,), _ = describe_release(tied, trace, Moment(0.4, "release"), np.ones((3, 3)))
    assert line.endswith("lengths of springs since t = 0: 2.5 to 1.0 m (4), 3.0 to 1.2 m (2, 3)")


def test_a_motor_that_stands_for_over_a_second_is_told() -> None:
    spin = np.zeros((26, 4, 3))
    spin[:, 1] = (10.0, 0.0, 0.0)
    spin[:6, 2] = (0.0, 0.0, 8.0)
    events = stalled_motors(WHEELED, make_trace(4, angular_velocity=spin), Schedule().switches())
    assert [(event.kind, event.blocks, event.text) for event in events] == [
        ("motor_stalled", (2,), "block 2 (Rotating Block) from 1.2 to 5.0 s")
    ]


def test_a_motor_that_starts_late_does_not_stall_before() -> None:
    spin = np.zeros((26, 4, 3))
    spin[:, 2] = (0.0, 0.0, 8.0)
    spin[16:, 1] = (10.0, 0.0, 0.0)
    trace = make_trace(4, angular_velocity=spin)
    assert stalled_motors(WHEELED, trace, Schedule(motors=3.0).switches()) == ()
    assert [
        event.time for event in stalled_motors(WHEELED, trace, Schedule(motors=1.0).switches())
    ] == [pytest.approx(1.2)]


def test_a_motor_that_broke_off_does_not_stall() -> None:
    alive = np.ones((26, 4), dtype=bool)
    alive[3:, 1:3] = False
    assert stalled_motors(WHEELED, make_trace(4, alive=alive), Schedule().switches()) == ()


def test_a_motor_that_turns_with_its_carrier_stalls() -> None:
    spin = np.ones((26, 4, 3)) * 7.0
    assert {
        e.blocks
        for e in stalled_motors(
            WHEELED, make_trace(4, angular_velocity=spin), Schedule().switches()
        )
    } == {
        (1,),
        (2,),
    }


def test_a_motor_that_has_swung_its_load_does_not_stall() -> None:
    """Block 2 carries block 3; a wheel without load that drove somewhere is still blocked there."""
    spin = np.zeros((26, 4, 3))
    spin[:6, 1:3] = (0.0, 0.0, 1.0)
    rotation = np.zeros((26, 4, 4))
    angle = np.minimum(np.arange(26) * 0.2, 1.0)
    rotation[..., 3] = 1.0
    for block in (1, 2, 3):
        rotation[:, block, 2], rotation[:, block, 3] = np.sin(angle / 2), np.cos(angle / 2)
    swung = make_trace(4, rotation=rotation, angular_velocity=spin)
    events = stalled_motors(WHEELED, swung, Schedule().switches())
    assert [event.blocks for event in events] == [(1,)]
    shaken = make_trace(4, angular_velocity=spin)
    events = stalled_motors(WHEELED, shaken, Schedule().switches())
    assert [event.blocks for event in events] == [(1,), (2,)]


def test_a_motor_that_is_switched_off_does_not_stall() -> None:
    schedule = Schedule(more=((1.0, "motors", 0.0), (3.0, "motors", -1.0)))
    events = stalled_motors(WHEELED, make_trace(4), schedule.switches())
    assert [event.text for event in events if event.blocks == (1,)] == [
        "block 1 (Powered Wheel) from 3.2 to 5.0 s"
    ]


def test_motors_that_stall_together_share_a_line() -> None:
    stalls = [
        RolloutEvent(0.2, "motor_stalled", (i,), f"block {i} (Rotating Block) from 0.2 to {end} s")
        for i, end in ((1, "1.4"), (2, "2.0"), (3, "1.4"), (4, "3.0"), (5, "4.0"))
    ]
    assert stall_lines(stalls[:3]) == [
        "Motor stalled: blocks 1, 3 (Rotating Block) from 0.2 to 1.4 s",
        "Motor stalled: block 2 (Rotating Block) from 0.2 to 2.0 s",
    ]
    assert stall_lines(stalls)[-1] == "Motor stalled: 1 more times"
