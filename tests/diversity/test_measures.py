"""Diversity of sets of machines: means over pairs, intervals, the same in every process."""

from __future__ import annotations

from collections import Counter
from itertools import combinations, pairwise
from random import Random
from statistics import fmean

import numpy as np
import pytest

from agentflow.diversity.measures import (
    LENGTH,
    WALKS,
    Graph,
    Measure,
    Measures,
    compare,
    cosines,
    diversity,
    embed,
)
from agentflow.diversity.topology import tree_edit_distance
from agentflow.machine import ROOT, Machine
from agentflow.machine.edits.random import random_machine
from tests.diversity.relabelling import relabel
from tests.machine.builders import CAR, CATAPULT
from tests.processes import run_python

NAMES = ("chamfer", "hausdorff", "iou", "graph_similarity", "tree_edit_distance")


def some_machines(count: int, seed: int = 0) -> list[Machine]:
    rng = Random(seed)
    return [random_machine(rng, size=(4, 10)) for _ in range(count)]


def means(measures: Measures) -> list[float]:
    return [getattr(measures, name).mean for name in NAMES]


def test_a_measure_is_the_mean_over_all_pairs() -> None:
    machines = some_machines(4)
    found = diversity(machines, 0).tree_edit_distance
    expected = [tree_edit_distance(a, b) for a, b in combinations(machines, 2)]
    assert found.mean == fmean(expected)
    assert found.interval is not None
    assert min(expected) <= found.interval.low <= found.mean <= found.interval.high


def test_copies_of_one_machine_do_not_differ() -> None:
    found = diversity([CAR, CAR, CAR], 0)
    assert means(found) == pytest.approx([0, 0, 1, 1, 0], abs=1e-6)
    assert found.chamfer.interval == (0, 0)


def test_fewer_than_two_machines_form_no_pair() -> None:
    for machines in ([], [CAR]):
        found = diversity(machines, 0)
        assert found == Measures(len(machines), *[Measure(None, None)] * 5)
    assert diversity([CAR, CATAPULT], 0).chamfer.interval is None


def test_machines_that_are_bare_starting_blocks_can_be_compared() -> None:
    bare = Machine((ROOT,))
    assert means(diversity([bare, bare], 0)) == pytest.approx([0, 0, 1, 1, 0], abs=1e-6)
    assert diversity([bare, CAR], 0).tree_edit_distance.mean == len(CAR) - 1


@pytest.mark.slow
def test_neither_order_nor_block_ids_matter() -> None:
    rng = Random(1)
    machines = some_machines(4)
    other = [relabel(machine, rng) for machine in machines[::-1]]
    assert means(diversity(machines, 0)) == pytest.approx(means(diversity(other, 0)), rel=1e-6)


@pytest.mark.slow
def test_sets_are_embedded_together() -> None:
    one, two = some_machines(3), some_machines(3, seed=1)
    first, second = compare([one, two], 0)
    assert first.tree_edit_distance == diversity(one, 0).tree_edit_distance
    assert first.chamfer == diversity(one, 0).chamfer
    vectors = embed([*one, *two], 0)
    pairs = np.tril_indices(3, -1)
    assert first.graph_similarity.mean == cosines(vectors[:3])[pairs].mean()
    assert second.graph_similarity.mean == cosines(vectors[3:])[pairs].mean()


def test_pairs_are_counted_over_all_sets() -> None:
    told: list[tuple[int, int]] = []
    compare([[CAR] * 3, [], [CATAPULT], [CAR] * 2], 0, lambda done, of: told.append((done, of)))
    assert told == [(1, 4), (2, 4), (3, 4), (4, 4)]


@pytest.mark.slow
def test_the_seed_decides_the_interval_but_not_the_mean_of_a_distance() -> None:
    one, two = (diversity(some_machines(10), seed).chamfer for seed in (0, 1))
    assert one.mean == two.mean
    assert one.interval != two.interval


def test_nodes_are_named_by_their_type_and_those_around_them() -> None:
    assert Graph("{0{15{63}{2}}{1}}").names == ["/0/1,15", "0/15/2,63", "15/63/", "15/2/", "0/1/"]


def test_walks_go_to_any_neighbour_with_equal_chance() -> None:
    around = {"0": "1", "1": "023", "2": "1", "3": "1"}
    graph = Graph("{0{1{2}{3}}}")
    walks = graph.walks(np.random.default_rng(0))
    assert [walk[0] for walk in walks] == graph.names * WALKS
    steps = Counter((a.split("/")[1], b.split("/")[1]) for walk in walks for a, b in pairwise(walk))
    assert set(steps) == {(a, b) for a, found in around.items() for b in found}
    assert [steps["1", b] / sum(steps["1", c] for c in "023") for b in "023"] == pytest.approx(
        [1 / 3] * 3, abs=0.05
    )
    assert {len(walk) for walk in walks} == {LENGTH}


def test_like_machines_have_like_graphs() -> None:
    """A car with one wheel fewer is nearer to the car than a catapult is."""
    vectors = embed([CAR, Machine(CAR.steps[:-1]), CATAPULT], 0)
    near, far = cosines(vectors)[0, 1:]
    assert 1 > near > far


@pytest.mark.slow
def test_results_are_the_same_in_every_process() -> None:
    code = (
        "from tests.diversity.test_measures import diversity, some_machines\n"
        "print(diversity(some_machines(4), 7))"
    )
    printed = [run_python("-c", code, PYTHONHASHSEED=seed).stdout for seed in ("1", "2")]
    assert printed[0] == printed[1] == f"{diversity(some_machines(4), 7)}\n"
    assert diversity(some_machines(4), 8) != diversity(some_machines(4), 7)
