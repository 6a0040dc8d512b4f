"""A resumed run reports differences from its record, and deletes nothing."""

from __future__ import annotations

from pathlib import Path

import pytest

from agentflow.app.design.notices import REMARK, Remarks, tell_unusable
from agentflow.app.design.plan import RunPlan
from agentflow.app.design.run import RunOptions, design, resume
from agentflow.config.run import build_config
from agentflow.errors import DamagedError, UnreachableError
from agentflow.llm.messages import Request
from agentflow.runs import Event, RunDirectory, read_events
from agentflow.version import __version__
from tests.runs.sources import InProcess
from tests.scripted import ScriptedClient

CONFIG = build_config({"task": "movement", "workflow": "single", "workers": 1})


def unreachable(_request: Request) -> str:
    raise UnreachableError("nobody answers")


def test_differences_are_reported_and_both_versions_kept(tmp_path: Path) -> None:
    run = RunDirectory.create(tmp_path, "run", {})
    Remarks(run, lambda _line: None).tell("waiting")
    for label in ("initial", "edited", "added"):
        run.event(Event("stage", label, {"valid": 1}))
    run.close()
    with (run.path / "events.jsonl").open("a") as file:
        file.write('{"kind')
    recorded = (run.path / "events.jsonl").read_bytes()[: -len('{"kind')]

    again = RunDirectory.resume(run.path)
    again.event(Event("stage", "initial", {"valid": 1}))
    again.event(Event("stage", "edited", {"valid": 2}))
    said: list[str] = []
    Remarks(again, said.append).tell_differences()
    again.close()
    why = f"a file in {run.path} was edited, or a simulation that had been cut off went through"
    assert said == [
        f"{run.path / 'events.jsonl'}: dropped a half-written last line (6 bytes)",
        f"recorded events that now differ: 1 (first: stage edited), because {why}; "
        "both versions are kept, the later one counts",
        f"recorded events that were not reproduced: 1 (first: stage added), because {why}; "
        "they are kept",
    ]
    assert (run.path / "events.jsonl").read_bytes().startswith(recorded)
    told = [event.data["text"] for event in read_events(run.path) if event.kind == REMARK]
    assert told == ["waiting", *said]


@pytest.mark.parametrize(
    ("document", "how"),
    [
        ({"agentflow": "0.0.1"}, f"agentflow 0.0.1, now {__version__}"),
        ({"commit": "0123456789abcdef"}, "commit 0123456789, now "),
        ({"began": "2001-01-01T00:00:00+00:00"}, "its files are newer than the run"),
    ],
)
def test_a_difference_by_other_code_is_told_as_such(
    document: dict[str, str], how: str, tmp_path: Path
) -> None:
    run = RunDirectory.create(tmp_path, "run", document)
    run.event(Event("stage", "initial", {"valid": 1}))
    run.close()
    again = RunDirectory.resume(run.path)
    again.event(Event("stage", "initial", {"valid": 2}))
    said: list[str] = []
    Remarks(again, said.append).tell_differences()
    again.close()
    assert f"because agentflow has changed since the run began ({how}" in said[0]
    assert "not because of what you did: to compare scores, begin a new run" in said[0]


def test_a_run_that_matches_its_record_reports_nothing(tmp_path: Path) -> None:
    run = RunDirectory.create(tmp_path, "run", {})
    said: list[str] = []
    run.event(Event("stage", "initial", {"valid": 1}))
    Remarks(run, said.append).tell_differences()
    run.close()
    again = RunDirectory.resume(run.path)
    again.event(Event("stage", "initial", {"valid": 1}))
    Remarks(again, said.append).tell_differences()
    again.close()
    assert said == []


def test_without_a_reply_a_new_run_is_removed_and_a_resumed_one_kept(tmp_path: Path) -> None:
    client = ScriptedClient(unreachable)
    with pytest.raises(UnreachableError, match=r"^nobody answers$"):
        design(CONFIG, tmp_path / "runs", RunOptions(client=client))
    assert list(tmp_path.iterdir()) == []

    run = RunDirectory.create(tmp_path, "run", RunPlan.of(CONFIG).run_document)
    run.save_machine("ab", "[]")
    run.close()
    with pytest.raises(UnreachableError) as caught:
        resume(run.path, RunOptions(client=client))
    assert str(caught.value) == (
        f"nobody answers; continue in Python: agentflow.resume({str(run.path)!r}, answer=...)"
    )
    assert (run.path / "machines" / "ab.json").read_text() == "[]\n"


def test_a_task_at_which_every_simulation_fails_is_named(tmp_path: Path) -> None:
    run = RunDirectory.create(tmp_path, "run", {})
    said: list[str] = []
    remarks = Remarks(run, said.append)
    for statuses in ({"diverged": 2}, {"diverged": 9, "ok": 1}, {"invalid": 9}, {}):
        tell_unusable(remarks, "wild/2", statuses)
    assert said == []
    tell_unusable(remarks, "wild/2", {"diverged": 7, "timeout": 1})
    run.close()
    assert said == [
        "all 8 simulations failed (diverged, timeout), so the scores say nothing about the "
        "machines: if other machines fare no better, the level or the family of wild/2 needs repair"
    ]


@pytest.mark.slow
def test_a_damaged_run_does_not_advise_to_resume_it_again(tmp_path: Path) -> None:
    started = design(CONFIG, tmp_path, RunOptions(pool=InProcess()), "run").run
    run = Path(started)
    (run / "result.json").unlink()
    calls = (run / "calls.jsonl").read_bytes().splitlines(keepends=True)
    (run / "calls.jsonl").write_bytes(b"{}\n" + b"".join(calls))
    events = (run / "events.jsonl").read_bytes()
    for told in (f"{run / 'calls.jsonl'}, line 1 is damaged", f"{run / 'events.jsonl'} is damaged"):
        with pytest.raises(DamagedError) as error:
            resume(run, RunOptions(pool=InProcess()))
        assert str(error.value).startswith(told)
        assert str(error.value).endswith("; restore it from a copy, or begin a new run")
        (run / "events.jsonl").write_bytes(b"{}\n" + events)
