"""Directories of training runs: written, cut and continued after a kill, read."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from pydantic import BaseModel

from agentflow.errors import RunError
from agentflow.training.record import About, TrainingRun, read_training

ABOUT = About(kind="sft", label="a model")


class Settings(BaseModel):
    steps: int = 4
    rate: float = 1e-6


class Answer(BaseModel):
    text: str


def save_checkpoint(path: Path, step: int) -> None:
    (path / f"checkpoint-{step}").mkdir()
    state = json.dumps(
        {"global_step": step, "log_history": [{"loss": float("nan")}]}
    )  # as Trainer writes
    (path / f"checkpoint-{step}" / "trainer_state.json").write_text(state)


def begin(path: Path, steps: int, checkpoint: int) -> None:
    """A run that is killed after some steps."""
    with TrainingRun.open(path, ABOUT, Settings(), resume=False) as run:
        for step in range(1, steps + 1):
            run.note(step, {"loss": 1 / step, "share": float("nan")})
            run.samples(step, [Answer(text="a"), Answer(text="b")])
            if step == checkpoint:
                save_checkpoint(path, step)


def test_a_run_is_read_as_it_was_written(tmp_path: Path) -> None:
    begin(tmp_path / "run", 2, 2)
    with TrainingRun.open(tmp_path / "run", ABOUT, Settings(), resume=True) as run:
        run.note(2, {"dev_loss": 0.5})
        run.finish({"loss": 0.5})
    record = read_training(tmp_path / "run")
    assert record.about == ABOUT
    assert record.config == {"steps": 4, "rate": 1e-6}
    rows = [{k: v for k, v in row.items() if k != "seconds"} for row in record.curves]
    assert rows == [
        {"step": 1, "loss": 1.0, "share": None},
        {"step": 2, "loss": 0.5, "share": None, "dev_loss": 0.5},
    ]
    assert record.samples[1].read_text() == '{"text":"a"}\n{"text":"b"}\n'
    assert record.result is not None
    assert record.result["loss"] == 0.5


def test_steps_after_the_last_checkpoint_are_cut(tmp_path: Path) -> None:
    begin(tmp_path, 4, 2)
    with (tmp_path / "curves.jsonl").open("a") as curves:
        curves.write('{"step": 5, "lo')
    (tmp_path / "checkpoint-4").mkdir()
    (tmp_path / "checkpoint-4" / "trainer_state.json").write_text('{"global_st')
    (tmp_path / ".123-result.json").write_text("{")
    with TrainingRun.open(tmp_path, ABOUT, Settings(), resume=True) as run:
        assert run.checkpoint == tmp_path / "checkpoint-2"
        run.note(3, {"loss": 9.0})
    record = read_training(tmp_path)
    assert [(row["step"], row["loss"]) for row in record.curves] == [(1, 1.0), (2, 0.5), (3, 9.0)]
    assert list(record.samples) == [1, 2]
    names = {path.name for path in tmp_path.iterdir()}
    assert {"checkpoint-4", ".123-result.json"}.isdisjoint(names)


def test_without_a_checkpoint_training_begins_again(tmp_path: Path) -> None:
    begin(tmp_path, 3, 0)
    with (tmp_path / "curves.jsonl").open("a") as curves:
        curves.write('{"step": 0, "seconds": 1.0, "eval": {}}\n')
    with TrainingRun.open(tmp_path, ABOUT, Settings(), resume=True) as run:
        assert run.checkpoint is None
    assert read_training(tmp_path).curves == ()


def test_seconds_go_on_counting(tmp_path: Path) -> None:
    begin(tmp_path, 1, 1)
    curves = tmp_path / "curves.jsonl"
    curves.write_text('{"step": 1, "seconds": 500.0}\n')
    with TrainingRun.open(tmp_path, ABOUT, Settings(), resume=True) as run:
        run.note(2, {})
    assert read_training(tmp_path).curves[-1]["seconds"] >= 500


def test_a_finished_run_keeps_everything(tmp_path: Path) -> None:
    begin(tmp_path, 3, 2)
    (tmp_path / "result.json").write_text("{}")
    with TrainingRun.open(tmp_path, ABOUT, Settings(), resume=True) as run:
        assert run.result == {}
    assert len(read_training(tmp_path).curves) == 3


def test_a_kill_before_the_first_step_leaves_a_folder_that_can_be_used(tmp_path: Path) -> None:
    (tmp_path / "config.yaml").write_text("steps: 9\n")
    with TrainingRun.open(tmp_path, ABOUT, Settings(), resume=True):
        assert read_training(tmp_path).config["steps"] == 4


def test_a_run_is_not_overwritten(tmp_path: Path) -> None:
    begin(tmp_path, 1, 1)
    with (
        pytest.raises(RunError, match="holds a training run; continue it with --resume"),
        TrainingRun.open(tmp_path, ABOUT, Settings(), resume=False),
    ):
        pass


def test_a_run_is_not_continued_with_another_configuration(tmp_path: Path) -> None:
    begin(tmp_path, 1, 1)
    with (
        pytest.raises(RunError, match="was started with another steps: 4, not 5"),
        TrainingRun.open(tmp_path, ABOUT, Settings(steps=5), resume=True),
    ):
        pass
    grpo = About(kind="grpo", label="a model")
    with (
        pytest.raises(RunError, match="is a run of sft, not of grpo"),
        TrainingRun.open(tmp_path, grpo, Settings(), resume=True),
    ):
        pass


def test_a_run_is_not_continued_with_other_files(tmp_path: Path) -> None:
    begin(tmp_path, 1, 1)  # without digests, as older runs
    with TrainingRun.open(tmp_path, about_files("1"), Settings(), resume=True):
        pass
    with TrainingRun.open(tmp_path / "new", about_files("1"), Settings(), resume=False):
        pass
    with (
        pytest.raises(RunError, match=r"the files of data have changed since .*: restore them, or"),
        TrainingRun.open(tmp_path / "new", about_files("2"), Settings(), resume=True),
    ):
        pass


def about_files(digest: str) -> About:
    return About(kind="sft", label="a model", inputs={"data": digest})


def test_other_folders_are_left_alone(tmp_path: Path) -> None:
    (tmp_path / "photo.png").write_text("")
    with (
        pytest.raises(RunError, match=r"is not a training run: it has photo\.png"),
        TrainingRun.open(tmp_path, ABOUT, Settings(), resume=True),
    ):
        pass
    assert [path.name for path in tmp_path.iterdir()] == ["photo.png"]


def test_one_process_at_a_time(tmp_path: Path) -> None:
    with (
        TrainingRun.open(tmp_path, ABOUT, Settings(), resume=False),
        pytest.raises(RunError, match="is in use by another process"),
        TrainingRun.open(tmp_path, ABOUT, Settings(), resume=True),
    ):
        pass


def test_a_folder_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with (
        pytest.raises(RunError, match=r"cannot write to .*; choose another folder with --out"),
        TrainingRun.open(tmp_path / "file" / "run", ABOUT, Settings(), resume=False),
    ):
        pass


def test_reading_names_what_is_wrong(tmp_path: Path) -> None:
    with pytest.raises(RunError, match=r"is not a training run: it has no training\.json"):
        read_training(tmp_path)
    begin(tmp_path / "run", 1, 1)
    (tmp_path / "run" / "training.json").write_text('{"kind": "sft", "label": "x", "format": 2}')
    with pytest.raises(RunError, match="format: expected 1, not 2"):
        read_training(tmp_path / "run")
    (tmp_path / "run" / "training.json").write_text(ABOUT.model_dump_json())
    (tmp_path / "run" / "curves.jsonl").write_text('{"loss": 1}\n')
    with pytest.raises(RunError, match=r"curves\.jsonl is damaged"):
        read_training(tmp_path / "run")
