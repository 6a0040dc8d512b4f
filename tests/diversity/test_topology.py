"""Machines as trees, and the edit distance between them."""

from __future__ import annotations

from itertools import combinations
from random import Random

import pytest

from agentflow.diversity.topology import tree_edit_distance, tree_text
from agentflow.machine import ROOT, Machine, Step
from agentflow.machine.edits.random import random_machine
from tests.diversity.relabelling import relabel

WHEEL, BLOCK, LOG, BRACE = 2, 15, 63, 7


def grow(*rows: tuple[int, int, int]) -> Machine:
    """A machine of (type, parent, face) rows below the Starting Block."""
    steps = (Step(place, *row) for place, row in enumerate(rows, 1))
    return Machine((ROOT, *steps))


ARM = grow((BLOCK, 0, 0), (LOG, 1, 0), (WHEEL, 0, 3))


def test_a_tree_lists_children_by_face() -> None:
    assert tree_text(ARM) == "{0{15{63}}{2}}"
    assert tree_text(grow((WHEEL, 0, 3), (BLOCK, 0, 0), (LOG, 2, 0))) == tree_text(ARM)


def test_a_two_ended_block_is_a_child_of_its_first_parent() -> None:
    braced = Machine((*ARM.steps, Step(4, BRACE, 0, 3, 2, 1)))
    assert tree_text(braced) == "{0{15{63}}{2}{7}}"
    assert tree_edit_distance(ARM, braced) == 1


@pytest.mark.parametrize(
    ("other", "distance"),
    [
        (ARM, 0),
        (grow((BLOCK, 0, 0), (LOG, 1, 0), (WHEEL, 0, 5)), 0),  # the same order of faces
        (grow((BLOCK, 0, 0), (BLOCK, 1, 0), (WHEEL, 0, 3)), 1),  # another type
        (grow((BLOCK, 0, 0), (LOG, 1, 0), (WHEEL, 0, 3), (WHEEL, 0, 4)), 1),  # one more
        (grow((LOG, 0, 0), (WHEEL, 0, 3)), 1),  # the log takes the place of the block below it
        (grow((WHEEL, 0, 0), (BLOCK, 0, 3), (LOG, 2, 0)), 2),  # the wheel on the other side
        (Machine((ROOT,)), 3),
    ],
)
def test_hand_worked_distances(other: Machine, distance: float) -> None:
    assert tree_edit_distance(ARM, other) == distance
    assert tree_edit_distance(other, ARM) == distance


def test_the_distance_agrees_with_all_possible_mappings() -> None:
    from apted.all_possible_mappings_ted import AllPossibleMappingsTED
    from apted.helpers import Tree

    machines = [random_machine(Random(seed), size=(2, 5)) for seed in range(8)]
    for a, b in combinations(machines, 2):
        trees = (Tree.from_text(tree_text(machine)) for machine in (a, b))
        assert tree_edit_distance(a, b) == AllPossibleMappingsTED(*trees).compute_edit_distance()


@pytest.mark.parametrize("seed", range(5))
def test_block_ids_do_not_matter(seed: int) -> None:
    rng = Random(seed)
    machine, other = random_machine(rng), random_machine(rng)
    renamed = relabel(machine, rng)
    assert renamed != machine
    assert tree_edit_distance(machine, renamed) == 0
    assert tree_edit_distance(machine, other) == tree_edit_distance(renamed, other)


@pytest.mark.parametrize("seed", range(5))
def test_distances_are_symmetric_and_obey_the_triangle_inequality(seed: int) -> None:
    rng = Random(seed)
    a, b, c = (random_machine(rng) for _ in range(3))
    assert tree_edit_distance(a, b) == tree_edit_distance(b, a) > 0
    assert tree_edit_distance(a, c) <= tree_edit_distance(a, b) + tree_edit_distance(b, c)
