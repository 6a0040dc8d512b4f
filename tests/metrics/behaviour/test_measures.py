"""How a designer behaves, from events as workflows write them."""

from __future__ import annotations

from dataclasses import replace

from agentflow.metrics.behaviour import Behaviour, behaviour, edits
from agentflow.metrics.intervals import Rate
from agentflow.runs.locations import BLIND, FEEDBACK, INITIAL
from agentflow.runs.record import RunRecord
from tests.metrics.events import attempt, candidate, edit, evaluation, node

ROUND = "refiner/feedback/traj-1/round-{}/node-{}/try-1/attempt-1"
FIRST, SECOND = ROUND.format(1, 0), ROUND.format(2, 1)


class Letters:
    """Machines named by letters: those with the same capital work alike."""

    def keeps_mechanism(self, before: str, after: str) -> bool:
        return before[0] == after[0]

    def size(self, before: str, after: str) -> float:
        return float(abs(len(after) - len(before)))


def record(*scores: float | None) -> RunRecord:
    """A run that makes A, then Ab blindly, Abcd from it and B from that, with these scores."""
    names = ("A", "Ab", "Abcd", "B")
    ends = {name: evaluation(f"{INITIAL}/traj-1", score, name) for name, score in
            zip(names, scores, strict=True)}  # fmt: skip
    return RunRecord.of(
        [
            replace(candidate(INITIAL, 1, scores[0]), machine="A"),
            attempt("refiner/blind/traj-1/attempt-1", machine="Ab"),
            replace(candidate(BLIND, 1, scores[1]), machine="Ab"),
            attempt(FIRST, machine="Abcd"),
            attempt(SECOND, machine="B"),
            replace(node(1, 1, 1, scores[2]), machine="Abcd"),
            replace(node(1, 2, 2, scores[3]), parent=1, machine="B"),
            *ends.values(),
        ]
    )


def observed(made: RunRecord, *, told: str = "") -> Behaviour:
    return behaviour(
        list(edits(made)), lambda _location: told, Letters(), {"refiner": 30}, metres=False
    )


def test_each_edit_joins_the_machine_before_and_after() -> None:
    pairs = [(one.before.machine, one.after.machine) for one in edits(record(1.0, 2.0, 3.0, 4.0))]
    assert pairs == [("A", "Ab"), ("Ab", "Abcd"), ("Abcd", "B")]


def test_only_edits_that_follow_a_reported_failure_are_repairs() -> None:
    assert observed(record(0.0, 2.0, 3.0, 4.0)).surface == Rate(0, 0)  # blind: it was not told
    assert observed(record(2.0, 0.0, 3.0, 4.0)).surface == Rate(1, 1)  # Ab to Abcd
    assert observed(record(2.0, 3.0, 1.0, 4.0)).surface == Rate(0, 1)  # Abcd to B
    assert observed(record(2.0, 1.0, 0.5, 4.0)).surface == Rate(1, 2)


def test_a_small_loss_is_no_failure() -> None:
    assert observed(record(10.0, 9.81, 10.0, 10.0), told="higher").mispredicted == Rate(0, 3)
    assert observed(record(10.0, 9.79, 10.0, 10.0), told="higher").mispredicted == Rate(1, 3)


def test_only_predicted_successes_can_be_mispredicted() -> None:
    assert observed(record(9.0, 1.0, 1.0, 1.0), told="it breaks").mispredicted == Rate(0, 0)


def test_sizes_and_errors_are_those_of_each_edit() -> None:
    found = observed(record(1.0, 2.0, 3.0, 8.0), told="score 5")
    assert (found.local, found.sizes) == (Rate(2, 3), (1.0, 2.0, 3.0))
    assert found.errors == (3.0, 2.0, -3.0)
    assert (found.error, found.bias) == (3.0, 2.0)
    assert observed(record(1.0, 2.0, 3.0, 8.0)).error is None


def test_crashed_simulations_are_left_out() -> None:
    assert [one.after.machine for one in edits(record(1.0, None, 3.0, 4.0))] == ["B"]


def test_random_edits_have_sizes_and_no_repairs() -> None:
    ends = [evaluation(f"{FEEDBACK}/traj-1/round-1", score, name) for name, score in
            (("A", 0.0), ("Ab", 1.0))]  # fmt: skip
    made = RunRecord.of([*ends, replace(edit(1, 1, "Ab"), parent="A")])
    assert observed(made) == Behaviour(local=Rate(1, 1), sizes=(1.0,), effort={"refiner": 30})


def test_runs_add_up() -> None:
    one = observed(record(1.0, 2.0, 3.0, 8.0), told="score 5")
    both = one + one + Behaviour()
    assert (both.local, both.sizes) == (Rate(4, 6), one.sizes * 2)
    assert (both.effort, both.shares) == ({"refiner": 60}, {"refiner": 1.0})
    assert Behaviour().shares == {}


def test_predictions_are_found_by_the_place_of_the_call() -> None:
    told = {FIRST: "score 4", SECOND: "score 6"}
    found = behaviour(
        list(edits(record(1.0, 2.0, 3.0, 4.0))),
        lambda location: told.get(str(location), ""),
        Letters(),
        {},
        metres=False,
    )
    assert found.errors == (1.0, 2.0)
