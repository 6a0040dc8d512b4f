"""Verified scores: what each variation changes, and what is made of the scores."""

from __future__ import annotations

import statistics
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

from agentflow.env.constants import constants
from agentflow.env.physics.assembly import assemble
from agentflow.env.physics.engine import EngineIdentity, World
from agentflow.env.physics.model import Assembly
from agentflow.env.pool.pool import RolloutPool
from agentflow.env.rollout import Feedback, Rollout
from agentflow.env.scene import Scene, SceneObject
from agentflow.env.simulation.simulate import simulate
from agentflow.env.simulation.variations import (
    DEFAULT,
    GENERAL,
    MOTORS,
    PULL,
    THRUST,
    TIMES,
    VARIATIONS,
    Variation,
    VariedEngine,
    most_variations_of,
    variations_of,
)
from agentflow.env.tasks.registry import get_task
from agentflow.env.verification import Verification, verify, verify_async
from agentflow.errors import UsageError
from agentflow.machine import Machine, library, place, read_machine
from agentflow.machine.geometry.vectors import length
from tests.machine.builders import build

ROOT = Path(__file__).parents[2]


def machine_at(path: str) -> Machine:
    machine = read_machine((ROOT / path).read_text(), tuple(library())).machine
    assert machine is not None
    return machine


CAR = machine_at("examples/car.json")


@pytest.fixture(scope="module")
def car() -> Verification:
    """The verification of the car on a flat road."""
    return verify(CAR, get_task("movement"))


@pytest.mark.slow
def test_the_verified_score_is_the_median(car: Verification) -> None:
    scores = [rollout.score for rollout in car.rollouts.values()]
    known = [score for score in scores if score is not None]
    assert list(car.rollouts) == [one.name for one in (*GENERAL, *MOTORS)]
    assert len(known) == 8
    assert car.score == statistics.median(known)
    assert (car.low, car.high) == (min(known), max(known))
    assert len(set(known)) == 8, "every variation changes the drive"


@pytest.mark.slow
def test_a_stronger_or_lighter_car_drives_farther(car: Verification) -> None:
    def score(name: str) -> float:
        found = car.rollouts[name].score
        assert found is not None
        return found

    assert score("masses -2 %") > score("default") > score("masses +2 %")
    assert score("motor torque +2 %") > score("default") > score("motor torque -2 %")


def test_the_default_is_the_plain_rollout(car: Verification) -> None:
    plain = simulate(CAR, get_task("movement"))
    assert car.default.digest == plain.digest
    fine = simulate(CAR, get_task("movement"), rate=4 * constants()["step_rate"])
    assert car.rollouts["4 x step rate"].digest == fine.digest


@pytest.mark.slow
async def test_workers_find_the_same_bits(car: Verification) -> None:
    task = get_task("movement")
    async with RolloutPool(2) as pool:
        found = await verify_async(CAR, task, partial(pool.run, CAR, task), car.default)
    assert found.rollouts["default"] is car.default
    assert {name: rollout.digest for name, rollout in found.rollouts.items()} == {
        name: rollout.digest for name, rollout in car.rollouts.items()
    }
    assert found.to_json() == car.to_json()


class Built(Exception):
    """The assembly is known; no world is needed."""


class Drawer:
    """An engine that only remembers what it was told to build."""

    identity = EngineIdentity("drawer", "1")
    assembly: Assembly
    scene: Scene

    def build(self, assembly: Assembly, scene: Scene, rate: float) -> World:  # noqa: ARG002
        self.assembly, self.scene = assembly, scene
        raise Built

    def close(self) -> None: ...


EQUIPPED = build((22, 0, 0), (26, 0, 1), (14, 0, 2), (56, 0, 3), (9, 0, 4, 1, 0), (45, 0, 4, 1, 1))
"""A motor, a propeller, two thrusters, a spring and a winch."""


@pytest.mark.parametrize("name", [name for name in VARIATIONS if name.endswith("%")])
def test_a_variation_changes_all_of_one_quantity(name: str) -> None:
    drawer, by = Drawer(), VARIATIONS[name]
    before = assemble(EQUIPPED, place(EQUIPPED), constants())
    box = SceneObject("box", "box", (1.0, 1.0, 1.0), (0.0, 5.0, 0.0), mass=3.0)
    slippery = SceneObject("ice", "box", (1.0, 1.0, 1.0), (9.0, 0.0, 0.0), friction=0.1)
    with pytest.raises(Built):
        VariedEngine(drawer, by, 0.8).build(before, Scene((box, slippery)), 120)
    after = drawer.assembly
    forces = [
        (old.force, new.force, by.pull)
        for kind in ("springs", "winches")
        for old, new in zip(
            getattr(before.devices, kind), getattr(after.devices, kind), strict=True
        )
    ]
    moving = (3.0, -2.0, 5.0)
    for thruster, other in zip(before.devices.thrusters, after.devices.thrusters, strict=True):
        forces += [(length(thruster.force), length(other.force), by.thrust)]
    for blade, changed in zip(before.devices.moved, after.devices.moved, strict=True):
        forces += [(length(blade.push(moving)), length(changed.push(moving)), by.thrust)]
    assert len(forces) == 5
    assert all(old > 0 for old, _, _ in forces)
    assert [new for _, new, _ in forces] == pytest.approx([old * by for old, _, by in forces])
    for old, new in zip(before.parts, after.parts, strict=True):
        assert new.mass == old.mass * by.masses
        assert new.inertia == tuple(moment * by.masses for moment in old.inertia)
        assert new.friction == old.friction * by.friction
        assert new.rolling_friction == old.rolling_friction * by.friction
    for joint, varied in zip(before.joints, after.joints, strict=True):
        assert varied.drive.torque == joint.drive.torque * by.motor_torque
        assert varied.drive.friction == joint.drive.friction * by.friction
        assert varied.strength == joint.strength
    assert [item.mass for item in drawer.scene.objects] == [3.0 * by.masses, 0.0]
    assert [item.friction for item in drawer.scene.objects] == [
        0.8 * by.friction,
        0.1 * by.friction,
    ]
    assert drawer.scene.friction == 0.8 * by.friction


def test_a_score_of_0_everywhere_stays_0() -> None:
    lone = machine_at("tests/machines/common/lone_root.json")
    found = verify(lone, get_task("movement"))
    assert {rollout.status for rollout in found.rollouts.values()} == {"ok"}
    assert found.score == pytest.approx(0.0, abs=1e-3)


def test_an_invalid_machine_is_not_simulated() -> None:
    lone = machine_at("tests/machines/common/lone_root.json")
    found = verify(lone, get_task("throwing"))
    assert (found.score, found.low, found.high) == (0.0, 0.0, 0.0)
    assert {rollout.status for rollout in found.rollouts.values()} == {"invalid"}
    assert [problem["code"] for problem in found.default.problems] == ["required_count"]


@pytest.mark.parametrize("status", ["timeout", "crashed"])
def test_a_missing_score_leaves_the_verification_incomplete(car: Verification, status: str) -> None:
    lost = Rollout(status, None, Feedback("", {}))  # type: ignore[arg-type]
    found = Verification({**car.rollouts, "masses +2 %": lost})
    assert (found.score, found.low, found.high) == (None, None, None)
    assert found.to_json()["scores"][2] == {
        "variation": "masses +2 %",
        "status": status,
        "score": None,
    }


def test_a_diverged_simulation_counts_as_0(car: Verification) -> None:
    gone = Rollout("diverged", 0.0, Feedback("", {}))
    found = Verification({**car.rollouts, "4 x step rate": gone})
    assert found.low == 0.0
    assert found.score is not None
    assert found.score > 40


def test_the_varied_rate_must_be_possible() -> None:
    fine = VARIATIONS["4 x step rate"]
    with pytest.raises(UsageError, match="the rate is 1920 Hz; it must be from 30 to 1000 Hz"):
        simulate(CAR, get_task("movement"), rate=480, variation=fine)


def test_names_are_unique_and_the_default_changes_nothing() -> None:
    assert next(iter(VARIATIONS.values())) is DEFAULT
    assert not DEFAULT.varies_bodies
    assert len(VARIATIONS) == 14


def varied(machine: Machine, level: str) -> tuple[Variation, ...]:
    """What the score of a machine is verified under, besides what every machine's is."""
    found = variations_of(machine, get_task(level))
    assert found[: len(GENERAL)] == GENERAL
    assert set(found) <= set(most_variations_of(get_task(level)))
    return found[len(GENERAL) :]


def test_only_what_a_machine_has_is_varied() -> None:
    assert varied(CAR, "movement") == MOTORS
    assert varied(machine_at("tests/machines/bridge/deep_truss.json"), "bridge") == ()
    assert varied(machine_at("tests/machines/flying/four_thrusters.json"), "flying") == THRUST
    assert varied(machine_at("tests/machines/springy_throw.json"), "throwing") == (*MOTORS, *PULL)
    throttled = machine_at("tests/machines/rocket/throttled.json")
    assert varied(throttled, "rocket/5") == (*THRUST, *TIMES)
    assert varied(replace(throttled, controls=throttled.controls[:1]), "rocket/5") == (
        *THRUST,
        *TIMES,
    ), "the end of a control is a time as well"


def test_starts_of_the_scene_are_no_start_times_of_the_machine() -> None:
    """The load of a bridge grows over time, and nothing of the machine is switched."""
    task = get_task("bridge")
    assert max(time for time, _, _ in task.schedule.switches()) > 1
    late = VARIATIONS["start times +2 %"]
    assert late.vary_switches(task.schedule.switches()) == list(task.schedule.switches())


def test_start_times_are_varied_in_order() -> None:
    late, early = (VARIATIONS[f"start times {sign}2 %"] for sign in ("+", "-"))
    switches = ((0.0, "motors", 1.0), (2.0, 7, 0.5), (2.01, "wind", 0.0))
    assert [entry for _, entry, _ in late.vary_switches(switches)] == ["motors", "wind", 7]
    assert [time for time, _, _ in late.vary_switches(switches)] == pytest.approx([0, 2.01, 2.04])
    assert [time for time, _, _ in early.vary_switches(switches)] == pytest.approx([0, 1.96, 2.01])
    assert DEFAULT.vary_switches(switches) == list(switches)


def test_a_later_start_changes_the_rollout() -> None:
    machine, task = machine_at("tests/machines/rocket/throttled.json"), get_task("rocket/5")
    plain, late = (
        simulate(machine, task, variation=VARIATIONS[name])
        for name in ("default", "start times +2 %")
    )
    assert plain.digest != late.digest


@pytest.mark.slow
def test_what_changes_nothing_does_not_count() -> None:
    """A rocket that flies up does not feel the friction of the ground that it left."""
    found = verify(machine_at("tests/machines/rocket/two_engines.json"), get_task("rocket/1"))
    assert not [name for name in found.rollouts if name.startswith("friction")]
    assert "thrust +2 %" in found.rollouts
    assert found.holding is not None
    assert found.holding.of == len(found.rollouts)


@pytest.mark.slow
async def test_a_repeated_verification_has_the_variations_of_the_first(car: Verification) -> None:
    task, few = get_task("movement"), [VARIATIONS[name] for name in ("default", "friction +2 %")]
    async with RolloutPool(1) as pool:
        run = partial(pool.run, CAR, task)
        found = await verify_async(CAR, task, run, car.default, few)
    assert list(found.rollouts) == ["default", "friction +2 %"]
    assert found.rollouts["friction +2 %"].digest == car.rollouts["friction +2 %"].digest


@pytest.mark.slow
def test_a_machine_that_breaks_is_verified_bit_for_bit() -> None:
    machine = machine_at("tests/machines/throwing/wind_arm.json")
    task = get_task("throwing/3")
    found = verify(machine, task)
    again = {one.name: simulate(machine, task, variation=one) for one in GENERAL[:3]}
    assert all(rollout.broken for rollout in found.rollouts.values())
    assert len({rollout.digest for rollout in found.rollouts.values()}) == len(found.rollouts)
    for name, rollout in again.items():
        assert rollout.digest == found.rollouts[name].digest


@pytest.mark.slow
async def test_a_variation_of_a_level_with_ten_trials_is_all_ten() -> None:
    """Two of its variations: test_records.py tries all of those of such a level."""
    machine, task = machine_at("tests/machines/lifting/drawbridge.json"), get_task("lifting")
    few = [DEFAULT, VARIATIONS["masses +2 %"]]
    async with RolloutPool(2) as pool:
        run = partial(pool.run, machine, task, seed=1)
        found = await verify_async(machine, task, run, repeated=few)
    assert {rollout.terms["trials"] for rollout in found.rollouts.values()} == {10.0}
    assert found.score == 10.0
