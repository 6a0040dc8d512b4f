"""Filtered loads and what gives way."""

from __future__ import annotations

from math import exp

import numpy as np
import pytest

from agentflow.env.physics.loads import Loads
from agentflow.env.physics.model import Joint, Strength

STEP = 1.0 / 120
BLEND = 1.0 - exp(-STEP / 0.02)
SHORT = 1e-6


def joints(count: int) -> list[Joint]:
    return [Joint(i + 1, i, i, i + 1, strength=Strength(100.0, 50.0)) for i in range(count)]


def pull(*forces: float, torque: float = 0.0) -> np.ndarray:
    return np.array([[force, 0.0, 0.0, 0.0, torque, 0.0] for force in forces])


def test_the_filter_starts_from_nothing_and_reaches_the_load() -> None:
    loads = Loads(joints(1), 0.02, STEP)
    loads.update(pull(50.0))
    assert loads.utilisation()[0] == pytest.approx(0.5 * BLEND)
    for _ in range(60):
        loads.update(pull(50.0))
    assert loads.utilisation()[0] == pytest.approx(0.5, rel=1e-6)


@pytest.mark.parametrize("finer", [1, 2, 8])
def test_a_hit_in_one_step_counts_the_same_at_finer_rates(finer: int) -> None:
    loads = Loads(joints(1), 0.02, STEP / finer, STEP)
    loads.update(pull(50.0 * finer))
    assert loads.utilisation()[0] == pytest.approx(0.5 * BLEND, rel=1e-9)


def test_a_hit_in_one_longer_step_counts_less() -> None:
    loads = Loads(joints(1), 0.02, 2 * STEP, STEP)
    loads.update(pull(25.0))
    assert loads.utilisation()[0] == pytest.approx(0.25 * (1.0 - exp(-2 * STEP / 0.02)), rel=1e-9)


def test_force_and_torque_are_judged_apart() -> None:
    loads = Loads(joints(1), SHORT, STEP)
    assert loads.update(pull(99.0, torque=49.0)) == {}
    assert loads.utilisation()[0] == pytest.approx(0.99)
    assert loads.update(pull(10.0, torque=51.0)) == {0: pytest.approx(1.02)}


def test_loads_just_below_the_strength_are_named() -> None:
    loads = Loads(joints(3), SHORT, STEP)
    assert loads.update(pull(94.0, 97.0, 95.5)) == {}
    assert loads.near == {1: pytest.approx(0.97), 2: pytest.approx(0.955)}
    assert loads.update(pull(10.0, 10.0, 10.0)) == {}
    assert loads.near == {}


def test_a_hit_in_a_part_of_a_step_counts_as_in_a_whole_one() -> None:
    loads = Loads(joints(1), 0.02, STEP, STEP)
    loads.update(pull(200.0), 4)
    assert loads.utilisation()[0] == pytest.approx(0.5 * BLEND, rel=1e-9)


def test_a_joint_gives_way_at_just_its_strength() -> None:
    assert Loads(joints(1), SHORT, STEP).update(pull(100.0)) == {0: 1.0}


def test_of_joints_in_a_row_the_furthest_gives_way_and_relieves_the_others() -> None:
    loads = Loads(joints(3), 0.02, STEP)
    loads.update(pull(10.0, 10.0, 10.0))
    before = loads.utilisation()
    hit = 100.0 / BLEND
    assert list(loads.update(pull(3 * hit, 2 * hit, 0.1 * hit))) == [1]
    after = loads.utilisation()
    assert after[0] == pytest.approx(before[0])
    assert np.isnan(after[1])


def test_joints_in_different_branches_give_way_together_the_most_loaded_first() -> None:
    tree = [*joints(2), Joint(3, 1, 1, 3, strength=Strength(100.0, 50.0))]
    loads = Loads(tree, SHORT, STEP)
    assert loads.update(pull(1.0, 120.0, 130.0)) == {
        2: pytest.approx(1.3),
        1: pytest.approx(1.2),
    }
    assert loads.update(pull(0.0, 0.0, 0.0)) == {}


def test_joints_without_strength_are_no_connections() -> None:
    free = Joint(1, 0, 0, 1)
    loads = Loads([free, *joints(1)], SHORT, STEP)
    assert loads.connections == [1]
    assert loads.update(pull(1e9, 1.0)) == {}


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_load_that_is_no_number_breaks_nothing_and_is_told(bad: float) -> None:
    loads = Loads(joints(2), SHORT, STEP)
    assert loads.update(pull(1.0, 1.0)) == {}
    assert loads.finite
    assert loads.update(pull(1.0, bad)) == {}
    assert not loads.finite
