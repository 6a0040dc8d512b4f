"""Where the machines of a source come from."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from agentflow.app.diversity.results import read_sources
from agentflow.errors import RunError
from agentflow.machine import Machine
from agentflow.machine.formats.bsg_writing import to_bsg
from agentflow.runs import read_events
from agentflow.training.evaluation.replies import JudgedReply
from agentflow.training.record import About, TrainingRun
from tests.machine.builders import CAR, CATAPULT, PUBLISHED_OVERLAP, build
from tests.training.test_run import Settings

RUNS = Path(__file__).parents[3] / "runs"


def only_machines(path: Path, valid: bool = False) -> tuple[Machine, ...]:
    (source,) = read_sources(path, valid)
    assert source.name == str(path)
    return source.machines


def write(path: Path, machine: Machine) -> None:
    path.write_text(machine.to_text())


def test_a_run_has_the_machines_that_its_last_stage_ended_with() -> None:
    path = RUNS / "recorded-throwing"
    ends = [e.data for e in read_events(path) if e.kind == "candidate"
            and e.label.startswith("env_feedback/")]  # fmt: skip
    assert [m.digest for m in only_machines(path)] == [e["machine"] for e in ends if e["machine"]]
    assert len(only_machines(path, valid=True)) == sum(e["valid"] for e in ends) > 1


def test_a_folder_of_runs_has_the_machines_of_all(tmp_path: Path) -> None:
    names = ("language-model-throwing", "recorded-throwing")
    for name in names:
        shutil.copytree(RUNS / name, tmp_path / name)
    each = [only_machines(tmp_path / name) for name in names]
    assert only_machines(tmp_path) == each[0] + each[1]


def test_files_that_are_no_trees_are_left_out_and_named(tmp_path: Path) -> None:
    write(tmp_path / "car.json", CAR)
    (tmp_path / "catapult.BSG").write_text(to_bsg(CATAPULT))
    (tmp_path / "package.json").write_text('{"name": "no machine"}')
    (tmp_path / "broken.bsg").write_text("<Machine></Machine>")
    (tmp_path / "notes.txt").write_text("not looked at")
    (source,) = read_sources(tmp_path, valid=False)
    assert [len(machine) for machine in source.machines] == [len(CAR), len(CATAPULT)]
    assert source.left_out == {
        "broken.bsg": "contains no machine: this is not a Besiege machine file: it has no Machine "
        "element with Blocks",
        "package.json": "contains no machine: no JSON list found; write the whole machine as a "
        'JSON list of objects like {"type": 1, "id": 1, "parent": 0, "face_id": 4}',
    }


def test_a_file_with_an_impossible_tree_is_left_out(tmp_path: Path) -> None:
    write(tmp_path / "a.json", CAR)
    write(tmp_path / "b.json", build((63, 0, 77)))
    (source,) = read_sources(tmp_path, valid=False)
    assert source.machines == (CAR,)
    assert source.left_out["b.json"].startswith("block 1: block 0 (Starting Block) has no face 77")


def test_valid_leaves_out_machines_whose_blocks_overlap(tmp_path: Path) -> None:
    write(tmp_path / "a.json", CAR)
    write(tmp_path / "b.json", PUBLISHED_OVERLAP)
    assert only_machines(tmp_path) == (CAR, PUBLISHED_OVERLAP)
    assert only_machines(tmp_path, valid=True) == (CAR,)


def reply(machine: Machine | None, valid: bool) -> JudgedReply:
    return JudgedReply(
        task="throwing", seed=0, text="", parsed=machine is not None, spatial=valid, valid=valid,
        status="ok" if valid else "invalid", score=1.0 if valid else 0.0,
        machine=machine and machine.to_json(),
    )  # fmt: skip


def test_a_training_run_is_a_source_for_each_step(tmp_path: Path) -> None:
    path = tmp_path / "training"
    with TrainingRun.open(path, About(kind="grpo", label="tiny"), Settings(), resume=False) as run:
        run.samples(40, [reply(CAR, True), reply(None, False), reply(PUBLISHED_OVERLAP, False)])
        run.samples(80, [reply(CATAPULT, True)])
    first, second = read_sources(path, valid=False)
    assert (first.name, second.name) == (f"{path}, step 40", f"{path}, step 80")
    assert first.machines == (CAR, PUBLISHED_OVERLAP)
    assert second.machines == (CATAPULT,)
    assert read_sources(path, valid=True)[0].machines == (CAR,)


def test_damaged_samples_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "training"
    with TrainingRun.open(path, About(kind="grpo", label="tiny"), Settings(), resume=False) as run:
        run.samples(40, [reply(CAR, True)])
    file = path / "samples" / "step-000040.jsonl"
    file.write_text(json.dumps({"machine": 1}) + "\n")
    with pytest.raises(RunError, match=r"damaged in line 1: expected a judged reply"):
        read_sources(path, valid=False)


def test_other_folders_are_refused(tmp_path: Path) -> None:
    with pytest.raises(RunError, match="holds no machines: expected a run, a sweep, a training"):
        read_sources(tmp_path, valid=False)
    with pytest.raises(RunError, match=r"cannot read .*nowhere: No such file"):
        read_sources(tmp_path / "nowhere", valid=False)
