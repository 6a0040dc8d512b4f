"""Extended types are legal only in tasks that list them."""

from __future__ import annotations

import pytest

from agentflow.machine import Brief, check, library

ROOT = {"type": 0, "id": 0, "parent": -1, "face_id": -1}


def alone(kind: int) -> list[dict[str, int]]:
    """A root with one block of the type on its top, or between its top and bottom."""
    if library()[kind].linear:
        ends = {"parent_a": 0, "face_id_a": 4, "parent_b": 0, "face_id_b": 5}
        return [ROOT, {"type": kind, "id": 1, **ends}]
    return [ROOT, {"type": kind, "id": 1, "parent": 0, "face_id": 4}]


def brief(*blocks: int) -> Brief:
    return Brief("job", "Do it.", (), (), (), blocks)


@pytest.mark.parametrize("kind", sorted(library().keys() - library().core))
def test_extended_types_need_a_task_that_lists_them(kind: int) -> None:
    assert [problem.code for problem in check(alone(kind)).problems] == ["type_not_allowed"]
    without = check(alone(kind), brief(*library().core))
    assert [problem.code for problem in without.problems] == ["type_not_allowed"]
    assert check(alone(kind), brief(*library().core, kind)).task_valid


@pytest.mark.parametrize("kind", [kind for kind in library().core if kind != 0])
def test_core_types_are_legal_by_default(kind: int) -> None:
    assert check(alone(kind)).machine_valid
    refused = check(alone(kind), brief(0))
    assert [problem.code for problem in refused.problems] == ["type_not_allowed"]
