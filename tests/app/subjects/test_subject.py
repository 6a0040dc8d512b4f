"""What the user names is resolved once, in the same way for every command."""

from __future__ import annotations

import cProfile
import pstats
from pathlib import Path

import pytest

from agentflow.app.subjects.subject import Subject, resolve
from agentflow.env.tasks.registry import get_task
from agentflow.errors import RunError, UsageError
from agentflow.machine.formats import detect
from agentflow.machine.validity import ValidMachine
from agentflow.runs import read_result
from tests.machine.builders import CAR

ROOT = Path(__file__).parents[3]
EXAMPLE = str(ROOT / "examples" / "car.json")
RECORDED = ROOT / "runs" / "recorded-throwing"


def test_a_file_is_read_once_and_checked_for_the_named_task() -> None:
    profile = cProfile.Profile()
    subject = profile.runcall(resolve, EXAMPLE, "movement/2", (), 5)
    readings = [
        calls
        for (file, _, function), (calls, *_) in pstats.Stats(profile).stats.items()  # type: ignore[attr-defined]
        if (file, function) == (detect.__file__, "read_any")
    ]
    assert readings == [1]
    assert (subject.task.name, subject.seed, subject.origin) == ("movement/2", 5, EXAMPLE)
    assert isinstance(subject.machine, ValidMachine)
    assert (subject.problems, subject.run) == ((), None)


def test_a_run_stands_for_its_best_machine_with_its_own_task_and_seed() -> None:
    subject = resolve(str(RECORDED), None)
    assert subject.run is not None
    assert subject.run.result == read_result(RECORDED)
    assert (subject.task.name, subject.seed, subject.recorded) == ("throwing", 0, True)
    assert subject.machine is not None
    assert subject.machine.to_json() == read_result(RECORDED).machine


def test_a_run_on_another_task_is_only_a_source_of_its_machine() -> None:
    subject = resolve(str(RECORDED), "throwing/2", ("window=1",))
    assert (subject.run, subject.recorded, subject.task.window) == (None, False, 1.0)


def test_what_cannot_be_meant_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="a machine file does not name its task; add --task"):
        resolve(EXAMPLE, None)
    with pytest.raises(UsageError, match="a run has its own task, knobs, seed and engine; remove"):
        resolve(str(RECORDED), None, seed=3)
    with pytest.raises(RunError, match="is not a run directory"):
        resolve(str(tmp_path), None)
    (tmp_path / "words.txt").write_text("no machine")
    with pytest.raises(UsageError, match=r"words\.txt contains no machine: "):
        resolve(str(tmp_path / "words.txt"), "movement")


def test_what_cannot_be_built_has_faults_and_what_is_not_valid_has_problems() -> None:
    task = get_task("gearing")
    nothing = Subject.of_text("words", task, 0)
    assert nothing.machine is None
    assert nothing.problems == nothing.faults != ()
    unfit = Subject.of_text(CAR.to_json(), get_task("throwing"), 0)
    assert unfit.machine == CAR
    assert [item.code for item in unfit.problems] == ["required_count"]
    assert unfit.faults == ()
