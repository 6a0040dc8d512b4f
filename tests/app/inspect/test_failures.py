"""What faces the wrong way, and the count over a folder of runs."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from agentflow.app.inspect.failures import count_failures, faces_wrong_way
from agentflow.env.tasks.registry import FAMILIES
from agentflow.errors import RunError
from agentflow.machine import Machine, read_machine
from agentflow.metrics.failure_kinds import STILL
from agentflow.runs import read_events
from tests.workflows.fakes import steps

RECORDED = Path(__file__).parents[3] / "runs" / "recorded-throwing"
SIDE, FRONT, TOP = 2, 0, 4
"""Faces of the Starting Block that look to x, z+ and y+."""


def machine(*blocks: tuple[int, int, int]) -> Machine:
    read = read_machine(steps(*blocks), range(1000))
    assert read.machine is not None, read.problems
    return read.machine


@pytest.mark.parametrize(
    ("blocks", "family", "wrong"),
    [
        ([(2, 0, SIDE)], "movement", False),
        ([(2, 0, FRONT)], "movement", True),
        ([(2, 0, TOP)], "delivery", True),
        ([(2, 0, TOP)], "throwing", False),
        ([(30, 0, TOP), (36, 1, 0)], "throwing", False),
        ([(30, 0, FRONT), (36, 1, 0)], "throwing", True),
        ([(30, 0, FRONT)], "throwing", False),
    ],
)
def test_wheels_that_drive_and_containers_that_hold(
    blocks: list[tuple[int, int, int]], family: str, wrong: bool
) -> None:
    assert faces_wrong_way(machine(*blocks), FAMILIES[family]) is wrong


def test_a_folder_counts_all_its_runs(tmp_path: Path) -> None:
    for name in ("a", "b/c"):
        shutil.copytree(RECORDED, tmp_path / name)
    one, both = count_failures(RECORDED), count_failures(tmp_path)
    assert (one["runs"], both["runs"]) == (1, 2)
    assert (both["replies"], both["machines"]) == (2 * one["replies"], 2 * one["machines"])
    assert [kind["count"] for kind in both["kinds"]] == [2 * k["count"] for k in one["kinds"]]
    moved = [e.data["moved"] for e in read_events(RECORDED) if e.kind == "evaluation"]
    (still,) = (kind["count"] for kind in one["kinds"] if kind["name"] == "no motion")
    assert still == sum(distance <= STILL for distance in moved)


def test_no_run_and_a_missing_or_false_machine_are_said(tmp_path: Path) -> None:
    with pytest.raises(RunError) as caught:
        count_failures(tmp_path)
    assert str(caught.value) == f"{tmp_path} contains no run"
    run = shutil.copytree(RECORDED, tmp_path / "run")
    first, second, *_ = sorted((run / "machines").iterdir())
    for file in (run / "machines").iterdir():
        file.write_bytes(first.read_bytes())
    with pytest.raises(RunError, match="is damaged: its machine does not match its name"):
        count_failures(run)
    second.unlink()
    first.unlink()
    with pytest.raises(
        RunError, match=r"is damaged: it has no readable machines/\w+\.json|its machine"
    ):
        count_failures(run)
