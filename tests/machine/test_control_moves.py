"""Random machines, edits and crossover of machines with control programs."""

from __future__ import annotations

from dataclasses import replace
from random import Random

import pytest

from agentflow.machine import Machine, check
from agentflow.machine.controls import MAX_CONTROLS, end_of
from agentflow.machine.edits.changes import cross
from agentflow.machine.edits.moves import MOVES, random_control
from agentflow.machine.edits.random import (
    all_neighbours,
    kinds_of_moves,
    random_edit,
    random_machine,
)
from agentflow.machine.tree import Control
from tests.env.levels import designed_task
from tests.machine.builders import CAR, build

BRIEF = designed_task().brief
FIXED = replace(BRIEF, limits=replace(BRIEF.limits, controls=None))
DRIVEN = replace(CAR, controls=(Control("motors", 0.0, 5.0, 1.0), Control((4, 6), 0.5, 2.0, -1.0)))


def test_random_machines_bring_programs_only_where_they_may() -> None:
    machines = [random_machine(Random(seed), BRIEF) for seed in range(6)]
    assert all(check(machine, BRIEF).task_valid for machine in machines)
    assert any(machine.controls for machine in machines)
    for seed, machine in enumerate(machines):
        assert random_machine(Random(seed), FIXED) == Machine(machine.steps)


def test_random_entries_end_within_the_window() -> None:
    for seed in range(200):
        control = random_control(CAR, 5.0, Random(seed))
        assert control is not None
        assert control.at >= 0.0
        assert control.lasts > 0.0
        assert end_of(control) <= 5.0
        assert abs(control.level) <= 1.0
    assert random_control(Machine(CAR.steps[:3]), 5.0, Random(0)) is None


def test_random_edits_change_programs_and_keep_them_valid() -> None:
    assert kinds_of_moves(FIXED) is MOVES
    machine, programs = DRIVEN, set()
    rng = Random(1)
    for _ in range(30):
        machine = random_edit(machine, rng, BRIEF)
        assert check(machine, BRIEF).task_valid
        programs.add(machine.controls)
    assert len(programs) > 3


def test_neighbours_include_other_programs() -> None:
    found = list(all_neighbours(DRIVEN, replace(BRIEF, blocks=(0, 1, 2)), Random(0)))
    others = [item for item in found if item.machine.steps == DRIVEN.steps]
    counts = sorted(len(item.machine.controls) for item in others)
    assert counts == [1, 1, 2, 2, 3]  # two without one entry, two with one changed, one with more
    assert {(item.block, item.faces) for item in others} == {(None, ())}


def test_a_full_program_grows_no_further() -> None:
    full = replace(CAR, controls=DRIVEN.controls[:1] * MAX_CONTROLS)
    (add,) = kinds_of_moves(BRIEF)["control"](full, ())
    assert add(Random(0)) is None


def test_crossover_keeps_the_program_and_brings_that_of_the_part() -> None:
    plain = build((63, 0, 0), (15, 1, 0))
    donor = replace(build((1, 0, 0), (22, 1, 0)), controls=(Control((2,), 1.0, 2.0, 0.5),))
    found = [cross(plain, donor, Random(seed), BRIEF) for seed in range(20)]
    brought = [machine for machine in found if machine.count(22)]
    assert brought
    for machine in brought:
        (motor,) = (step.id for step in machine if step.type == 22)
        assert machine.controls == (Control((motor,), 1.0, 2.0, 0.5),)
    assert all(cross(DRIVEN, plain, Random(s), BRIEF).controls for s in range(3))


@pytest.mark.parametrize("seed", range(3))
def test_the_same_generator_gives_the_same_edit(seed: int) -> None:
    once, twice = (random_edit(DRIVEN, Random(seed), BRIEF) for _ in range(2))
    assert once == twice
