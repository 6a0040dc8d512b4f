"""Mechanism classes, by the stated rules on made-up rollouts and on real ones."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from agentflow.env.measurements import Contact, Energy, Hit, Measured
from agentflow.env.mechanism import DRIVES, Mechanism, classify, work_shares
from agentflow.env.rollout import Broken, Feedback, Rollout
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.registry import get_task
from agentflow.machine import Machine, library, read_machine
from tests.env.fakes import make_rollout, make_trace

MACHINES = Path(__file__).parents[1] / "machines"
HIT = Hit(0.0, (0.0, 0.0, 0.0), 0.0)


def machine(*blocks: tuple[int, int, int]) -> Machine:
    """The root and blocks of (type, parent, face)."""
    steps = [{"type": 0, "id": 0, "parent": -1, "face_id": -1}] + [
        {"type": kind, "id": id_, "parent": parent, "face_id": face}
        for id_, (kind, parent, face) in enumerate(blocks, 1)
    ]
    read = read_machine(steps, tuple(library())).machine
    assert read is not None
    return read


def energy(springs: float = 0.0, motors: float = 0.0, gravity: float = 0.0) -> Energy:
    return Energy(1.0, springs, motors, gravity, thrown=0.0, machine=0.0)


def rollout(
    blocks: int,
    work: Energy | None = None,
    touches: tuple[tuple[int | str, int | str], ...] = (),
    moment: dict[str, Any] | None = None,
    broken: tuple[Broken, ...] = (),
    dead: tuple[int, ...] = (),
) -> Rollout:
    contacts = tuple(Contact(a, b, HIT, HIT, standing=True, last=1.0) for a, b in touches)
    trace = make_trace(blocks, measured=Measured(contacts, (), work))
    alive = np.ones_like(trace.alive)
    alive[1:, list(dead)] = False
    made = make_rollout(replace(trace, alive=alive), broken)
    return replace(made, feedback=Feedback("", {"moment": moment}))


CAR = machine((63, 0, 0), (2, 1, 0))
"""Root, log, powered wheel."""
CUP = machine((5, 0, 0), (30, 1, 0), (36, 2, 0))
"""Root, hinge, container, boulder."""
SEAT = machine((63, 0, 0), (36, 1, 0))
"""Root, log, boulder."""
RELEASE = {"time": 1.0, "name": "release", "body": 3, "holder": 2}


@pytest.mark.parametrize(
    ("work", "drive"),
    [
        (energy(springs=20.0, motors=10.0), "springs"),
        (energy(springs=19.0, motors=10.0), "mixed"),
        (energy(motors=5.0, gravity=-50.0), "motors"),
        (energy(springs=-30.0, gravity=4.0), "falling weight"),
        (energy(motors=0.9), "nothing"),
    ],
)
def test_the_drive_did_two_thirds_of_the_work(work: Energy, drive: str) -> None:
    found = classify(CUP, rollout(4, work))
    assert found is not None
    assert found.drive == drive
    assert drive in DRIVES


def test_motors_are_wheels_if_a_powered_wheel_touches_the_scene_else_rotors_or_motors() -> None:
    driving = classify(CAR, rollout(3, energy(motors=9.0), ((2, "ground"),)))
    assert driving == Mechanism("wheels", "driven wheels", "nothing")
    turning = classify(CAR, rollout(3, energy(motors=9.0), ((1, "ground"),)))
    assert turning == Mechanism("motors", "blocks", "nothing")
    flying = classify(machine((14, 0, 0)), rollout(2, energy(motors=9.0)))
    assert flying == Mechanism("rotors", "nothing", "nothing")


def test_a_payload_is_in_a_container_or_on_an_open_seat_and_leaves_an_arm_or_the_body() -> None:
    swung = classify(CUP, rollout(4, energy(springs=9.0), moment=RELEASE))
    assert swung == Mechanism("springs", "container", "arm")
    tipped = {**RELEASE, "body": 2, "holder": 1}
    assert classify(SEAT, rollout(3, energy(gravity=9.0), moment=tipped)) == Mechanism(
        "falling weight", "open seat", "body"
    )
    kept = classify(SEAT, rollout(3, energy(gravity=9.0)))
    assert kept == Mechanism("falling weight", "open seat", "nothing")


def test_breakage_comes_first_but_only_until_the_decisive_moment() -> None:
    early, late = (Broken(2, 30, 1, time, 1.0) for time in (0.5, 1.5))
    for item, let_go in ((early, "breakage"), (late, "arm")):
        found = classify(CUP, rollout(4, energy(springs=9.0), moment=RELEASE, broken=(item,)))
        assert found is not None
        assert found.let_go == let_go


def test_a_decoupler_that_has_opened_lets_go() -> None:
    held = machine((4, 0, 0), (63, 1, 0))
    opened = classify(held, rollout(3, energy(gravity=9.0), dead=(1,)))
    assert opened == Mechanism("falling weight", "nothing", "decoupler")


def test_objects_are_held_by_what_touches_them() -> None:
    moment = {"time": 1.0, "name": "top", "body": "cargo", "holder": None}
    for kind, hold in ((30, "container"), (27, "grabber"), (63, "contact")):
        found = classify(machine((kind, 0, 0)), rollout(2, energy(), ((1, "cargo"),), moment))
        assert found is not None
        assert found.hold == hold


def test_without_a_finished_rollout_there_is_no_class() -> None:
    assert classify(CAR, make_rollout(None)) is None
    done = rollout(3, energy())
    assert classify(CAR, done) is not None
    assert classify(CAR, replace(done, status="diverged")) is None
    assert classify(CAR, rollout(3)) is None  # recorded before work was measured


def test_shares_count_positive_work_only_and_sum_to_one() -> None:
    assert work_shares(energy(springs=3.0, motors=1.0, gravity=-7.0)) == {
        "springs": 0.75,
        "motors": 0.25,
        "falling weight": 0.0,
    }
    assert work_shares(energy(springs=0.5)) is None


@pytest.mark.parametrize(
    ("task", "name", "expected"),
    [
        ("throwing", "spring_arm", "springs / container / arm"),
        ("throwing", "boulder_on_tower", "nothing / open seat / nothing"),
        ("throwing", "spun_container", "motors / container / nothing"),
        ("movement", "plain_car", "wheels / driven wheels / nothing"),
        ("throwing", "boulder_off_car", "wheels / open seat / body"),
        ("throwing", "wind_arm", "springs / open seat / breakage"),
        pytest.param(
            "movement",
            "slow_tipping",
            "wheels / driven wheels / breakage",
            marks=pytest.mark.pybullet,  # with MuJoCo it does no work
        ),
        ("movement", "spinning_top", "motors / blocks / nothing"),
    ],
)
def test_real_machines(task: str, name: str, expected: str) -> None:
    data = json.loads((MACHINES / task / f"{name}.json").read_text())
    read = read_machine(data, tuple(library())).machine
    assert read is not None
    assert str(classify(read, simulate(read, get_task(task)))) == expected
