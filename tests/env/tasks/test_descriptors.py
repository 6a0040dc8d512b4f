"""Descriptors of families: what they measure, and that every family declares two or three."""

from __future__ import annotations

import math

import numpy as np
import pytest

from agentflow.env.measurements import Energy, Measured
from agentflow.env.mechanism import DRIVES
from agentflow.env.tasks.base import (
    count_driven_wheels,
    measure,
    number_drive,
    release_height,
    share_of,
    weigh,
    wheelbase,
)
from agentflow.env.tasks.registry import FAMILIES, get_task
from tests.env.fakes import make_rollout, make_trace
from tests.env.test_mechanism import CAR, CUP, RELEASE, energy, machine, rollout


@pytest.mark.parametrize("family", FAMILIES.ours)
def test_every_family_declares_two_or_three_axes_and_measures_them_all(family: str) -> None:
    declared = get_task(family).descriptors
    assert 2 <= len(declared) <= 3
    assert len({item.axis.name for item in declared}) == len(declared)
    found = measure(declared, CUP, rollout(4, energy(springs=9.0), moment=RELEASE))
    assert [item.axis for item in found] == [item.axis for item in declared]
    assert all(item.value is not None and math.isfinite(item.value) for item in found)


def test_nothing_is_measured_without_a_finished_rollout() -> None:
    found = measure(get_task("movement").descriptors, CAR, make_rollout(None))
    assert [item.value for item in found] == [None, None]


def test_machines_are_measured_as_built() -> None:
    done = rollout(3)
    assert (count_driven_wheels(CAR, done), wheelbase(CAR, done)) == (1.0, 0.0)
    assert weigh(CAR, done) == pytest.approx(0.25 + 1.0 + 1.0)
    train = machine((63, 0, 0), (63, 1, 0), (2, 1, 2), (2, 2, 2))
    apart = abs(wheelbase(train, rollout(5)))
    assert apart > 0.0


def test_shares_without_work_are_zero() -> None:
    idle = rollout(4, Energy(1.0, 0.1, 0.2, 0.0, 0.0, 0.0))
    assert [share_of(name)(CUP, idle) for name in ("springs", "motors")] == [0.0, 0.0]
    driven = rollout(4, energy(springs=3.0, motors=1.0))
    assert [share_of(name)(CUP, driven) for name in ("springs", "motors")] == [0.75, 0.25]


def test_release_height_is_that_at_the_release_or_else_at_the_start() -> None:
    path = np.array([(0.0, float(sample), 0.0) for sample in range(26)])
    trace = make_trace(4, paths={3: path}, measured=Measured())
    still = make_rollout(trace)
    assert release_height(CUP, still) == 0.0
    thrown = rollout(4, moment=RELEASE)
    thrown = type(thrown)(**{**vars(thrown), "trace": trace})
    assert release_height(CUP, thrown) == 5.0
    assert release_height(CAR, rollout(3)) is None


def test_the_drive_is_a_number_in_the_list_of_drives() -> None:
    number = number_drive(CUP, rollout(4, energy(springs=9.0)))
    assert number is not None
    assert DRIVES[int(number)] == "springs"
