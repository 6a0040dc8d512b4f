import pickle
from dataclasses import replace

import pytest

from agentflow.machine import Brief, Machine, Step, check, read_machine
from agentflow.machine.brief import Limits
from agentflow.machine.formats.coordinates import read_coordinates, to_coordinates
from agentflow.machine.validity import ValidMachine, problems_of
from tests.machine.builders import CAR, CATAPULT, Spec, build

BRIEF = Brief("throwing", "Throw.", (), (), (), (0, 1, 15, 22, 30, 36, 63), {36: 1})


def problems(machine: Machine) -> list[tuple[str, tuple[int, ...], str]]:
    return [(problem.code, problem.blocks, problem.message) for problem in check(machine).problems]


def test_a_valid_machine() -> None:
    report = check(CATAPULT.to_text())
    assert report.to_json() == {
        "file_valid": True,
        "spatial_valid": True,
        "machine_valid": True,
        "repaired": False,
        "problems": [],
        "overlaps": [],
        "size": [5.0, 8.9, 6.0],
    }
    assert (report.machine, report.task_valid) == (CATAPULT, True)


def test_a_file_invalid_machine_has_no_spatial_verdict() -> None:
    report = check("nothing")
    assert report.to_json() == {
        "file_valid": False,
        "spatial_valid": None,
        "machine_valid": False,
        "repaired": False,
        "problems": [problem.to_json() for problem in read_machine("nothing").problems],
        "overlaps": [],
        "size": None,
    }
    assert not report.task_valid


def test_all_sources_are_judged_alike() -> None:
    sources = (CAR, CAR.to_json(), CAR.to_text(), read_machine(CAR.to_json()))
    assert len({repr(check(source)) for source in sources}) == 1


def test_a_machine_object_is_checked_too() -> None:
    broken = Machine((*CAR.steps, Step(7, 2, 3, 5)))
    assert problems(broken) == [
        (
            "face_not_found",
            (7,),
            "block 7: block 3 (Powered Wheel) has no face 5; its only face is 0",
        )
    ]


def test_overlaps_say_by_how_much_and_what_is_free() -> None:
    assert problems(build((63, 0, 0), (49, 1, 7), (36, 1, 8))) == [
        (
            "overlap",
            (2, 3),
            "block 3 (Boulder) and block 2 (Grip Pad) overlap by 0.8 x 0.5 x 0.35 m; "
            "free faces of block 1: 0, 1, 2, 3, 4, 5, 6, 9, 10, 11, 12",
        )
    ]


def test_two_blocks_on_one_face_are_a_problem_of_its_own() -> None:
    codes = [problem[0] for problem in problems(build((15, 0, 0), (15, 0, 0)))]
    assert codes == ["face_occupied", "overlap"]
    assert problems(build((15, 0, 0), (15, 0, 0)))[0][2] == (
        "blocks 1, 2 share face 0 of block 0 (Starting Block); a face holds only one; "
        "free faces of block 0: 1, 2, 3, 4, 5"
    )


def test_two_ended_blocks_share_faces_freely() -> None:
    machine = build((1, 0, 0), (7, 0, 0, 1, 0), (9, 0, 0, 1, 0), (9, 0, 0, 0, 0))
    assert check(machine).machine_valid


def line(face: int, logs: int, *last: int) -> list[Spec]:
    """A row of blocks on a face of the root: 3 m logs first, then others."""
    kinds = [63] * logs + list(last)
    return [
        (kind, 0 if index == 0 else -1, face if index == 0 else 0)
        for index, kind in enumerate(kinds)
    ]


def chain(*lines: list[Spec]) -> Machine:
    specs: list[Spec] = []
    for entries in lines:
        for kind, parent, face in entries:  # type: ignore[misc]
            specs.append((kind, len(specs) if parent < 0 else parent, face))
    return build(*specs)


@pytest.mark.parametrize(
    ("axis", "first", "second", "limit"), [("x", 3, 2, 17.0), ("z", 0, 1, 17.0)]
)
def test_the_exact_limit_is_legal(axis: str, first: int, second: int, limit: float) -> None:
    # 1 for the root, 5 logs and a small block: 17
    fits = chain(line(first, 3), line(second, 2, 15))
    assert check(fits).machine_valid
    assert check(fits).size == tuple(limit if name == axis else 1.0 for name in "xyz")
    over = chain(line(first, 3), line(second, 2, 15, 87))
    assert problems(over) == [
        (
            "size_limit",
            (3, 7),
            f"the machine is 17.2 m along {axis}, 0.2 m over the limit of 17.0 m; "
            f"block 7 (Elastic Pad) extends furthest to {axis}- and block 3 (Log) to {axis}+",
        )
    ]


def test_the_height_limit() -> None:
    # 1 + 2 * 3 + 2 + 0.5 = 9.5
    assert check(chain(line(4, 2, 1), line(5, 0, 2))).size == (2.0, 9.5, 2.0)
    assert check(chain(line(4, 2, 1), line(5, 0, 2))).machine_valid
    over = check(chain(line(4, 2, 1), line(5, 0, 15)))
    assert [problem.code for problem in over.problems] == ["size_limit"]


def test_a_tasks_own_size_limit_counts() -> None:
    small = replace(BRIEF, limits=Limits((1.0, 1.0, 2.0)), required={})
    assert check(build((15, 0, 0)), small).machine_valid
    assert not check(build((1, 0, 0)), small).machine_valid


def test_task_validity_is_told_apart() -> None:
    report = check(build((1, 0, 0)), BRIEF)
    assert (report.machine_valid, report.task_valid) == (True, False)
    assert [problem.to_json() for problem in report.problems] == [
        {
            "code": "required_count",
            "blocks": [],
            "message": "the task requires exactly 1 block of type 36 (Boulder); there are 0",
        }
    ]
    assert check(build((36, 0, 0)), BRIEF).task_valid
    assert check(build((36, 0, 0), (36, 0, 1)), BRIEF).problems[0].blocks == (1, 2)


def test_types_outside_the_tasks_list_are_file_invalid() -> None:
    report = check(build((2, 0, 0)), BRIEF)
    assert (report.file_valid, report.task_valid) == (False, False)
    assert [problem.code for problem in report.problems] == ["type_not_allowed"]


def test_very_many_overlaps_are_counted_and_not_all_told() -> None:
    heap = check(build(*[(15, 0, 0)] * 30))
    assert len(heap.overlaps) == 435
    assert [problem.message for problem in heap.problems][-1] == (
        "235 more pairs of blocks overlap"
    )


@pytest.mark.parametrize(("more", "left"), [(0, 0), (2, 1)])
def test_two_hundred_overlaps_are_all_told(more: int, left: int) -> None:
    """Twenty blocks on one face, five on another, `more` on a third: 190 pairs, 10, `left`."""
    heap = check(build(*[(15, 0, 0)] * 20, *[(15, 0, 1)] * 5, *[(15, 0, 2)] * more))
    sizes = [len(problem.blocks) for problem in heap.problems if problem.code == "overlap"]
    assert len(heap.overlaps) == 200 + left
    assert sizes == [2] * 200 + [0] * left


def test_a_valid_machine_carries_the_proof_for_its_task() -> None:
    proven = check(CATAPULT, BRIEF).machine
    assert isinstance(proven, ValidMachine)
    assert proven.is_valid_for(replace(BRIEF, objective="Throw far."))
    assert not proven.is_valid_for(replace(BRIEF, required={36: 2}))
    assert [item.code for item in problems_of(proven, replace(BRIEF, required={36: 2}))] == [
        "required_count"
    ]
    sent = pickle.loads(pickle.dumps((proven, BRIEF)))  # as to a worker
    assert sent[0].is_valid_for(sent[1])


def test_a_proven_machine_equals_the_same_machine() -> None:
    proven = check(CATAPULT, BRIEF).machine
    assert proven == CATAPULT
    assert {proven: 1}[CATAPULT] == 1
    assert (repr(proven), proven and proven.digest) == (repr(CATAPULT), CATAPULT.digest)


def test_what_is_not_valid_for_the_task_or_changed_later_has_no_proof() -> None:
    assert not isinstance(check(CATAPULT).machine, ValidMachine)
    smaller = check(CATAPULT, replace(BRIEF, limits=Limits(blocks=1)), Limits(blocks=40))
    assert not isinstance(smaller.machine, ValidMachine)
    assert not isinstance(check(CATAPULT, replace(BRIEF, required={36: 2})).machine, ValidMachine)
    proven = check(CATAPULT, BRIEF).machine
    assert isinstance(proven, ValidMachine)
    longer = replace(proven, steps=(*proven.steps, Step(14, 36, 3, 0)))
    assert problems_of(longer, BRIEF) == check(Machine(longer.steps), BRIEF).problems != ()


def test_positions_alone_do_not_prove_that_a_machine_begins_with_the_given_blocks() -> None:
    brief = replace(BRIEF, given=build((15, 0, 0)))
    report = check(read_coordinates(to_coordinates(CATAPULT), brief.blocks), brief)
    assert report.task_valid
    assert report.machine is not None
    assert [item.code for item in problems_of(report.machine, brief)] == ["given_altered"]
