"""Numbers of searches, by hand."""

from __future__ import annotations

import pytest

from agentflow.metrics.intervals import Rate
from agentflow.metrics.search import (
    attempts_per_child,
    best_after_expansions,
    best_after_rounds,
    child_validity,
    expansions_per_round,
    most_rounds,
)
from agentflow.runs.record import RunRecord
from tests.metrics.events import candidate, expansion, node


def test_attempts_and_children() -> None:
    made = RunRecord.of(
        [expansion(1, 1, "vxxv"), expansion(1, 2, "vv"), expansion(2, 1, "xxxx")]
    ).expansions
    assert attempts_per_child(made) == 10 / 4
    assert child_validity(made, 2) == Rate(4, 6)
    assert expansions_per_round([made]) == 2
    assert attempts_per_child([]) is None
    assert expansions_per_round([]) is None
    assert attempts_per_child(RunRecord.of([expansion(1, 1, "xx")]).expansions) is None


def test_published_expansions_of_random_and_best_of_n_search() -> None:
    chain = [expansion(1, round_, "v") for round_ in range(1, 6)]
    broad = [expansion(1, round_, "vvvv") for round_ in range(1, 6)]
    assert expansions_per_round([chain]) == 5
    assert expansions_per_round([broad, []]) == 20


@pytest.fixture
def record() -> RunRecord:
    return RunRecord.of(
        [
            candidate("initial", 1, 9.0),
            candidate("blind_refinement", 1, 2.0),
            candidate("blind_refinement", 2, None, valid=False),
            candidate("blind_refinement", 3, None),
            expansion(1, 1, "vv"),
            node(1, 1, 1, 1.0),
            node(1, 2, 1, 3.0),
            expansion(1, 2, "vv"),
            node(1, 3, 2, None),
            node(1, 4, 2, 5.0),
            expansion(3, 1, "v"),
            node(3, 1, 1, 4.0),
        ]
    )


def test_a_tree_cut_after_rounds(record: RunRecord) -> None:
    assert best_after_rounds(record, 0) == {1: 2.0}
    assert best_after_rounds(record, 1) == {1: 3.0, 3: 4.0}
    assert best_after_rounds(record, 2) == {1: 5.0, 3: 4.0}
    assert most_rounds(record) == 2


def test_a_tree_cut_after_expansions(record: RunRecord) -> None:
    assert best_after_expansions(record, 1) == {1: 2.0, 3: 4.0}
    assert best_after_expansions(record, 3) == {1: 3.0, 3: 4.0}
    assert best_after_expansions(record, 4) == {1: 5.0, 3: 4.0}


def test_a_search_without_a_machine_keeps_what_it_began_with() -> None:
    """Nothing but refusals in the first; the second began with what the simulation refused."""
    record = RunRecord.of(
        [
            candidate("initial", 1, 2.0),
            candidate("initial", 2, 0.0, valid=False),
            candidate("initial", 3, 7.0),
            expansion(1, 1, "xx"),
            expansion(2, 1, "xx"),
        ]
    )
    assert best_after_rounds(record, 1) == best_after_expansions(record, 1) == {1: 2.0}


def test_without_a_blind_refinement_searches_begin_with_the_initial_machines() -> None:
    record = RunRecord.of([candidate("initial", 1, 9.0), expansion(1, 1, "v"), node(1, 1, 1, 1.0)])
    assert best_after_rounds(record, 1) == {1: 9.0}
    assert most_rounds(RunRecord()) == 0
