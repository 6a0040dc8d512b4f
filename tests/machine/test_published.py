"""Examples from the paper."""

from agentflow.machine import check, place
from tests.machine.builders import CATAPULT, PUBLISHED_OVERLAP


def test_the_published_overlap_example() -> None:
    report = check(PUBLISHED_OVERLAP)
    assert report.file_valid
    assert report.spatial_valid is False
    assert report.overlaps == ((4, 7), (5, 6))
    assert [(problem.code, problem.blocks) for problem in report.problems] == [
        ("face_occupied", (4, 7)),
        ("face_occupied", (5, 6)),
        ("overlap", (4, 7)),
        ("overlap", (5, 6)),
    ]


def test_the_published_catapult() -> None:
    geometry = place(CATAPULT)
    assert (geometry[10].center, geometry[10].facing) == ((1.0, 2.0, -2.0), "x-")
    assert (geometry[12].center, geometry[12].facing) == ((1.0, 6.9, -2.0), "y+")
    assert geometry[13].center == (1.0, 7.45, -2.0)
    assert geometry[5].center == (-2.0, 0.0, 1.5)
    assert geometry[9].center == (2.0, 2.0, -3.0)
    assert min(geometry.blocks, key=lambda placed: placed.center[0]).id == 5
    assert min(geometry.blocks, key=lambda placed: placed.center[2]).id == 9
    assert check(CATAPULT).machine_valid
