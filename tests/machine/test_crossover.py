"""Crossover: always another valid machine, made of blocks of both."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agentflow.env.tasks.registry import get_task
from agentflow.errors import UsageError
from agentflow.machine.brief import LONE_ROOT
from agentflow.machine.edits.changes import cross
from agentflow.machine.edits.random import random_machine
from agentflow.machine.tree import ROOT, Machine, Step
from agentflow.machine.validity import check

PLAIN = Machine((ROOT, Step(1, 63, 0, 0), Step(2, 15, 1, 0)))
"""A log on the root and a small block on the log."""


@pytest.mark.slow
@settings(max_examples=20)
@given(st.integers(0, 10_000))
def test_the_result_is_another_machine_that_meets_the_task(seed: int) -> None:
    rng, brief = Random(seed), get_task("throwing").brief
    machine, donor = random_machine(rng, brief), random_machine(rng, brief)
    try:
        crossed = cross(machine, donor, rng, brief)
    except UsageError:
        return
    assert crossed not in (machine, donor)
    assert check(crossed, brief).task_valid
    blocks = [Counter(step.type for step in item) for item in (machine, donor, crossed)]
    assert not blocks[2] - (blocks[0] + blocks[1])


def test_the_same_generator_gives_the_same_machine() -> None:
    brief = get_task("movement").brief
    machine, donor = (random_machine(Random(seed), brief) for seed in (1, 2))
    assert cross(machine, donor, Random(3), brief) == cross(machine, donor, Random(3), brief)


def test_a_part_brings_what_is_attached_to_it_and_takes_the_place_of_another() -> None:
    donor = Machine((ROOT, Step(1, 1, 0, 0), Step(2, 2, 1, 0), Step(3, 7, 1, 1, 2, 1)))
    found = {cross(PLAIN, donor, Random(seed)) for seed in range(40)}
    assert Machine((ROOT, Step(1, 63, 0, 0), Step(2, 2, 1, 0))) in found
    assert all(check(item).machine_valid for item in found)


def test_machines_without_parts_are_refused() -> None:
    with pytest.raises(UsageError, match="no part of the donor fits"):
        cross(LONE_ROOT, PLAIN, Random(0))
    with pytest.raises(UsageError, match="no part of the donor fits"):
        cross(PLAIN, LONE_ROOT, Random(0))


def test_given_blocks_stay() -> None:
    brief = replace(get_task("movement").brief, given=Machine(PLAIN.steps[:2]))
    for seed in range(10):
        other = Machine((*PLAIN.steps[:2], Step(2, 2, 1, 0), Step(3, 2, 1, 1)))
        assert (
            cross(PLAIN, other, Random(seed), replace(brief, required={})).steps[:2]
            == (PLAIN.steps[:2])
        )
