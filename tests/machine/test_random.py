from __future__ import annotations

from collections import Counter
from dataclasses import replace
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agentflow.errors import UsageError
from agentflow.machine import ROOT, Brief, Machine, check, library
from agentflow.machine.edits.moves import MOVES, additions
from agentflow.machine.edits.random import random_edit, random_machine
from tests.machine.builders import CAR, CATAPULT, build


def brief(*blocks: int, required: dict[int, int] | None = None) -> Brief:
    return Brief("any", "Move.", (), (), (), (0, *blocks), required or {})


THROWING = brief(1, 2, 7, 9, 15, 22, 30, 36, 63, required={36: 1})
EVERYTHING = brief(*(kind for kind in library() if kind))


@pytest.mark.parametrize("task", [None, THROWING, EVERYTHING, brief(63), brief(7, 15)])
@pytest.mark.parametrize("size", [(2, 2), (5, 20), (60, 60)])
def test_random_machines_are_valid(task: Brief | None, size: tuple[int, int]) -> None:
    if size[0] == 2 and task is not None and 36 in task.required:
        task = brief(36, 15, required={36: 1})
    for seed in range(3 if size[1] < 60 else 1):  # one of 60 takes longer than thirty of 20
        machine = random_machine(Random(seed), task, size)
        assert size[0] <= len(machine) <= size[1]
        assert check(machine, task).task_valid


def test_the_same_seed_gives_the_same_machine() -> None:
    assert random_machine(Random(5)) == random_machine(Random(5)) != random_machine(Random(6))


def test_sizes_are_drawn_from_the_whole_range() -> None:
    rng = Random(8)
    assert {len(random_machine(rng, None, (2, 4))) for _ in range(20)} == {2, 3, 4}


@pytest.mark.parametrize(
    ("task", "size"),
    [
        (brief(36, required={36: 1}), (3, 5)),
        (brief(), (2, 2)),
        (brief(15, required={36: 1}), (2, 3)),
    ],
)
def test_impossible_machines_are_an_error(task: Brief, size: tuple[int, int]) -> None:
    with pytest.raises(
        UsageError, match=f"found no valid machine of {size[0]} to {size[1]} blocks"
    ):
        random_machine(Random(0), task, size)


def even(counts: Counter[Machine], expected: set[Machine], draws: int) -> None:
    """Chi-squared test: all occur, about equally often (within five standard deviations)."""
    assert set(counts) == expected
    mean = draws / len(expected)
    freedom = len(expected) - 1
    chi = sum((counts[machine] - mean) ** 2 / mean for machine in expected)
    assert abs(chi - freedom) < 5 * (2 * freedom) ** 0.5 + 5


def test_growth_is_uniform_over_all_legal_steps() -> None:
    # wheels get in each other's way beside a log, so many of the steps are illegal
    start, types = build((63, 0, 0), (2, 1, 1)), (2, 36, 63)
    legal = {
        grown
        for kind in types
        for parent, count in ((0, 6), (1, 13), (2, 1))
        for face in range(count)
        if check(grown := build((63, 0, 0), (2, 1, 1), (kind, parent, face))).machine_valid
    }
    assert 10 < len(legal) < 3 * 18
    rng, task = Random(1), replace(brief(*types), given=start)
    drawn = Counter(random_machine(rng, task, (4, 4)) for _ in range(1500))
    even(drawn, legal, 1500)


def test_the_first_block_is_uniform_over_types_and_faces() -> None:
    rng, task = Random(2), brief(1, 15, 63)
    drawn = Counter(random_machine(rng, task, (2, 2)) for _ in range(1800))
    expected = {build((kind, 0, face)) for kind in (1, 15, 63) for face in range(6)}
    even(drawn, expected, 1800)


def test_the_second_end_is_uniform_over_the_faces_of_other_blocks() -> None:
    rng, start = Random(3), build((15, 0, 4))
    on_face_2 = additions(start, (7,))[6 + 2]
    drawn = Counter(on_face_2(rng) for _ in range(1200))
    expected = {build((15, 0, 4), (7, 1, 2, 0, face)) for face in range(6)}
    even(drawn, expected, 1200)  # type: ignore[arg-type]
    assert additions(Machine((ROOT,)), (7,))[0](rng) is None


def apply_all(kind: str, machine: Machine, *types: int) -> set[Machine]:
    return {move(Random(0)) for move in MOVES[kind](machine, types)}  # type: ignore[misc]


def test_the_kinds_of_edit() -> None:
    machine = build((15, 0, 0), (15, 1, 0), (2, 2, 1))
    assert set(MOVES) == {"add", "remove", "swap", "re-attach", "re-orient", "actuate"}
    assert len(additions(machine, (63,))) == 6 + 5 + 5 + 1 - 3
    assert len(additions(machine, (7,))) == 6 + 5 + 5 + 1
    assert apply_all("remove", machine) == {build((15, 0, 0), (15, 1, 0))}
    assert apply_all("actuate", machine, 2, 40) == {build((15, 0, 0), (15, 1, 0), (40, 2, 1))}
    assert apply_all("actuate", machine, 2) == set()
    assert len(apply_all("swap", machine, 2, 7, 15)) == 3
    braced = build((15, 0, 0), (7, 0, 1, 1, 1))
    assert apply_all("swap", braced, 7, 9) == {build((15, 0, 0), (9, 0, 1, 1, 1))}
    assert apply_all("remove", braced) == {build((15, 0, 0))}
    # block 1 has no other earlier block; 2 may go to the root, 3 to the root and to 1
    assert len(apply_all("re-attach", machine)) == 5 + 5 + 4
    assert apply_all("re-orient", build((15, 0, 0))) == {
        build((15, 0, face)) for face in range(1, 6)
    }
    # the two Left faces of a wooden block face the same way
    assert build((1, 0, 0), (15, 1, 2)) not in apply_all("re-orient", build((1, 0, 0), (15, 1, 1)))


def test_actuation_goes_both_ways() -> None:
    pairs = {kind: block.counterpart for kind, block in library().items() if block.counterpart}
    assert pairs == {2: 40, 40: 2, 46: 60, 60: 46, 28: 5, 5: 28, 13: 19, 19: 13}
    assert all(library()[a].size == library()[b].size for a, b in pairs.items())


def test_edits_are_uniform_over_the_kinds_that_have_a_legal_one() -> None:
    # one wheel on the root: it has no other place, and only wheels are allowed
    start, task, rng = build((2, 0, 4)), brief(2, 40), Random(4)
    counts: Counter[str] = Counter()
    added: Counter[Machine] = Counter()
    for _ in range(2500):
        edited = random_edit(start, rng, task)
        if len(edited) == 3:
            counts["add"] += 1
            added[edited] += 1
        elif len(edited) == 1:
            counts["remove"] += 1
        else:
            counts["swap or actuate" if edited[1].type == 40 else "re-orient"] += 1
    shares = {kind: count / 2500 for kind, count in counts.items()}
    assert shares == {
        "add": pytest.approx(0.2, abs=0.04),
        "remove": pytest.approx(0.2, abs=0.04),
        "swap or actuate": pytest.approx(0.4, abs=0.05),
        "re-orient": pytest.approx(0.2, abs=0.04),
    }
    legal = {
        grown
        for kind in (2, 40)
        for parent, face in (*((0, face) for face in range(6)), (1, 0))
        if check(grown := build((2, 0, 4), (kind, parent, face))).machine_valid
    }
    even(added, legal, counts["add"])


def test_edits_keep_what_the_task_requires() -> None:
    rng, machine = Random(6), random_machine(Random(7), THROWING)
    for _ in range(60):
        edited = random_edit(machine, rng, THROWING)
        assert edited != machine
        assert check(edited, THROWING).task_valid
        machine = edited


def test_no_legal_edit_is_an_error() -> None:
    with pytest.raises(UsageError, match="this machine has no legal edit"):
        random_edit(Machine((ROOT,)), Random(0), brief())


@given(st.sampled_from((CAR, CATAPULT)), st.randoms(use_true_random=False))
def test_random_edits_are_valid(machine: Machine, rng: Random) -> None:
    assert check(random_edit(machine, rng, EVERYTHING), EVERYTHING).machine_valid
