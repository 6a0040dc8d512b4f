"""Whatever can be switched follows the schedule of a rollout, more than once."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from agentflow.env.rollout import Trace
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.base import Schedule
from agentflow.env.tasks.families.movement import Movement
from agentflow.env.tasks.registry import get_task
from agentflow.machine.blocks.library import library
from agentflow.machine.brief import Brief
from agentflow.machine.geometry.placement import place
from agentflow.machine.tree import Machine
from tests.env.machines import machine
from tests.env.physics.rig import face_towards

FOOT = ((0, -1, -1), (35, 0, 0), (35, 0, 1), (35, 0, 2), (35, 0, 3))
FLYING, GRABBER, BOULDER, COG, WINCH = 14, 27, 36, 39, 45


@dataclass(frozen=True)
class Anything(Movement):
    """Movement with every block of the library."""

    @property
    def brief(self) -> Brief:
        return replace(super().brief, blocks=tuple(library()))


def run(tree: Machine, schedule: Schedule, window: float = 3.0) -> Trace:
    task = get_task("movement", {"window": window})
    rollout = simulate(tree, Anything(**{**vars(task), "schedule": schedule}))
    assert rollout.problems == ()
    assert rollout.trace is not None
    return rollout.trace.even


def test_powered_cogs_turn_at_the_speed_that_is_asked_for() -> None:
    switches = ((0.0, "motors", 2.0), (1.0, "motors", -0.5), (2.0, "motors", 0.0))
    trace = run(machine(*FOOT, (COG, 0, 4)), Schedule(more=switches))
    spin = np.abs(trace.angular_velocity[:, 5, 1])
    assert spin[[2, 4, 7, 9, 12]] == pytest.approx([4, 4, 1, 1, 0], abs=0.02)
    assert np.sign(trace.angular_velocity[4, 5, 1]) == -np.sign(trace.angular_velocity[7, 5, 1])


def test_flying_blocks_push_until_they_are_switched_off() -> None:
    trace = run(machine(FOOT[0], (FLYING, 0, 4)), Schedule(more=((0.6, "motors", 0.0),)), 1.0)
    speed = trace.velocity[:, 0, 1]
    assert (np.diff(speed[:4]) > 10.0).all()
    assert (np.diff(speed[3:]) < -0.2 * 32.81 + 0.01).all()


def test_grabbers_let_go_when_the_schedule_says_so() -> None:
    rows = [*FOOT, (63, 0, 4), (15, 5, 0)]
    rows.append((63, 6, face_towards(machine(*rows), 6, "z+")))
    low = [f.face_id for f in place(machine(*rows)).blocks[7].faces if f.facing == "y-"][-1]
    tree = machine(*rows, (GRABBER, 7, low), (BOULDER, 8, 0))
    trace = run(tree, Schedule(more=((1.0, "grabbers", 0.0),)), 2.0)
    high = trace.centre[:, 9, 1]
    assert high[:6] == pytest.approx(high[0], abs=0.02)
    assert high[7] < high[0] - 1.0


def test_winches_reel_in_hold_and_pay_out() -> None:
    base = (FOOT[0], (35, 0, 1), (35, 0, 2), (35, 0, 3), (63, 0, 4), (5, 0, 0), (63, 5, 0))
    tree = machine(*base)
    post, log = face_towards(tree, 4, "z+"), face_towards(tree, 6, "y+")
    crane = machine(*base, (WINCH, 4, post + 2, 6, log + 2))
    switches = ((1.4, "winches", 0.0), (2.0, "winches", -1.0))
    length = run(crane, Schedule(springs=1.0, more=switches)).length[:, 0]
    assert length[:6] == pytest.approx(length[0], abs=0.01)
    assert length[7] < length[5] - 0.1
    assert length[9:11] == pytest.approx(length[8], abs=0.03)
    assert length[12] > length[10] + 0.1
