"""Verified scores: what each variation changes, and what is made of the scores."""

from __future__ import annotations

import statistics
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
from agentflow.env.simulation.variations import DEFAULT, VARIATIONS, VariedEngine
from agentflow.env.tasks.registry import get_task
from agentflow.env.verification import Verification, verify, verify_async
from agentflow.errors import UsageError
from agentflow.machine import Machine, place, read_machine

ROOT = Path(__file__).parents[2]
BY_NAME = {variation.name: variation for variation in VARIATIONS}


def machine_at(path: str) -> Machine:
    machine = read_machine((ROOT / path).read_text()).machine
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
    assert len(known) == len(VARIATIONS) == 8
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
        found = await verify_async(partial(pool.run, CAR, task), car.default)
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


@pytest.mark.parametrize("name", [name for name in BY_NAME if name.endswith("%")])
def test_a_variation_changes_all_of_one_quantity(name: str) -> None:
    drawer, by = Drawer(), BY_NAME[name]
    before = assemble(CAR, place(CAR), constants())
    box = SceneObject("box", "box", (1.0, 1.0, 1.0), (0.0, 5.0, 0.0), mass=3.0)
    slippery = SceneObject("ice", "box", (1.0, 1.0, 1.0), (9.0, 0.0, 0.0), friction=0.1)
    with pytest.raises(Built):
        VariedEngine(drawer, by, 0.8).build(before, Scene((box, slippery)), 120)
    after = drawer.assembly
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
    fine = BY_NAME["4 x step rate"]
    with pytest.raises(UsageError, match="the rate is 1920 Hz; it must be from 30 to 1000 Hz"):
        simulate(CAR, get_task("movement"), rate=480, variation=fine)


def test_names_are_unique_and_the_default_changes_nothing() -> None:
    assert len(BY_NAME) == len(VARIATIONS)
    assert VARIATIONS[0] is DEFAULT
    assert not DEFAULT.varies_bodies


@pytest.mark.slow
def test_a_machine_that_breaks_is_verified_bit_for_bit() -> None:
    machine = machine_at("tests/machines/throwing/wind_arm.json")
    task = get_task("throwing/3")
    found, again = verify(machine, task), verify(machine, task)
    assert all(rollout.broken for rollout in found.rollouts.values())
    assert len({rollout.digest for rollout in found.rollouts.values()}) == 8
    assert {name: rollout.digest for name, rollout in found.rollouts.items()} == {
        name: rollout.digest for name, rollout in again.rollouts.items()
    }


@pytest.mark.slow
async def test_a_variation_of_a_level_with_ten_trials_is_all_ten() -> None:
    machine = machine_at("tests/machines/lifting/drawbridge.json")
    async with RolloutPool(2) as pool:
        found = await verify_async(partial(pool.run, machine, get_task("lifting"), seed=1))
    assert {rollout.terms["trials"] for rollout in found.rollouts.values()} == {10.0}
    assert found.score == 10.0
