"""Orders in which blocks can be put on, against a search through all orders by another check."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from random import Random

import pytest

from agentflow.machine import ROOT, Geometry, Machine, library, place
from agentflow.machine.edits.random import random_machine
from agentflow.machine.geometry.pieces import UNBUILDABLE, build_order
from agentflow.machine.problems import Problem
from tests.machine.builders import CAR, CATAPULT, build

MACHINES = Path(__file__).parents[1] / "machines"
FAR = 60
"""Steps of half a metre that a block comes from."""


def read(name: str) -> Machine:
    return Machine.from_file(MACHINES / name)


def fits(geometry: Geometry, block: int, there: frozenset[int]) -> bool:
    """Whether a block can be put on: its parents are there, and it slides in, 0.5 m at a time."""
    placed = geometry[block]
    if not there.issuperset(placed.step.parents):
        return False
    for other in there if placed.step.parents and not placed.two_ended else ():
        box = geometry[other]
        held = placed.step.parent == other and library()[box.type].shape == "container"
        if box.two_ended or held:
            continue
        for away in range(FAR):
            shift = [0.5 * away * part for part in placed.front]
            sides = zip(
                placed.box_min, placed.box_max, box.box_min, box.box_max, shift, strict=True
            )
            if all(a + s < q - 1e-6 and p + 1e-6 < b + s for a, b, p, q, s in sides):
                return False
    return True


def some_order(geometry: Geometry) -> bool:
    """Whether any order of the standard blocks after the root fits, by trying them all."""
    blocks = frozenset(placed.id for placed in geometry.blocks if not placed.two_ended)

    @cache
    def completes(there: frozenset[int]) -> bool:
        left = blocks - there
        return not left or any(
            completes(there | {block}) for block in left if fits(geometry, block, there)
        )

    return completes(frozenset({0}))


def require_order(machine: Machine) -> tuple[int, ...]:
    """The order of a machine, in which every block fits onto those before it."""
    geometry = place(machine)
    order = build_order(geometry)
    assert not isinstance(order, Problem), order.message
    assert sorted(order) == list(range(len(machine)))
    for index, block in enumerate(order):
        assert fits(geometry, block, frozenset(order[:index]))
    return order


def test_a_lone_root_and_a_car_are_built_in_the_order_of_their_ids() -> None:
    assert require_order(Machine((ROOT,))) == (0,)
    assert require_order(CAR) == tuple(range(7))
    assert require_order(CATAPULT) == tuple(range(14))  # a boulder goes into its container


def test_two_ended_blocks_come_last() -> None:
    machine = build((7, 0, 0, 0, 1), (63, 0, 4), (9, 2, 0, 0, 5), (63, 0, 2))
    assert require_order(machine) == (0, 2, 4, 1, 3)


def test_a_later_block_comes_first_where_an_earlier_one_would_close_its_way() -> None:
    hanging = build((15, 0, 4), (63, 1, 2), (15, 2, 11), (15, 0, 3))
    assert require_order(hanging) == (0, 1, 2, 4, 3)


def test_blocks_between_two_arms_that_face_each_other_block_each_other() -> None:
    problem = build_order(place(read("bridge/clamp.json")))
    assert problem == Problem(
        UNBUILDABLE,
        (7, 8, 9, 10),
        "the machine cannot be built in any order: block 9 (Wooden Block) is in the way of block 8 "
        "(Hinge), which block 7 carries, and block 7 (Wooden Block) is in the way of block 10 "
        "(Hinge), which block 9 carries; move one of them",
    )


def test_a_block_in_the_way_of_what_it_carries_is_named() -> None:
    problem = build_order(place(read("picking/crane_without_grabber.json")))
    assert isinstance(problem, Problem)
    assert problem.message == (
        "the machine cannot be built in any order: block 10 (Log) is in the way of block 19 "
        "(Wooden Block), which it carries; move one of them"
    )


def test_an_order_is_found_exactly_where_there_is_one() -> None:
    small = [random_machine(Random(f"order {seed}"), size=(4, 11)) for seed in range(12)]
    found = []
    for machine in (*small, read("bridge/clamp.json")):
        order = build_order(place(machine))
        found.append(not isinstance(order, Problem))
        assert found[-1] == some_order(place(machine))
        if found[-1]:
            require_order(machine)
    assert set(found) == {True, False}


@pytest.mark.slow
def test_every_order_of_a_random_machine_fits() -> None:
    built = 0
    for seed in range(50):
        machine = random_machine(Random(f"build {seed}"), size=(5, 40))
        if not isinstance(build_order(place(machine)), Problem):
            require_order(machine)
            built += 1
    assert 25 < built < 50
