"""The file of a session: what is written is read again, and damage is named."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from agentflow.errors import RunError, UsageError
from agentflow.study.session import (
    FILE,
    Action,
    Audio,
    End,
    Note,
    Pause,
    SessionLog,
    SessionStart,
    StudioTest,
    read_session,
)
from tests.study.example import Clock

ROOT = [{"type": 0, "id": 0, "parent": -1, "face_id": -1}]
TWO = [*ROOT, {"type": 15, "id": 1, "parent": 0, "face_id": 0}]


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def log(tmp_path: Path, clock: Clock) -> Iterator[SessionLog]:
    start = SessionStart(
        task="throwing", limit_s=600, mode="guided", rationale="an arm", machine=ROOT
    )
    log = SessionLog.begin(tmp_path / "one", start, clock)
    yield log
    log.finish("left")


def test_a_session_is_read_as_it_was_written(log: SessionLog, clock: Clock) -> None:
    clock.at += 2
    log.append(Audio(at=log.now, file="speech.webm"))
    log.append(Action(at=log.now, do="add", block=1, type=15, machine=TWO))
    log.append(StudioTest(at=4.0, seconds=3.0, machine=TWO, score=1.5, status="ok", run="a/b"))
    log.append(Note(at=7.5, text="<b>short</b>"))
    clock.at += 6
    log.finish("finished")
    session = read_session(log.path)
    assert session.start.rationale == "an arm"
    assert session.start.limit_s == 600
    assert [event.kind for event in session.events] == [
        *("audio", "action", "trial", "note", "end"),
    ]
    assert session.of(Note)[0].text == "<b>short</b>"
    assert session.of(End)[0].at == 8.0
    assert session.seconds == 8.0
    assert read_session(log.path / FILE) == session
    assert {len(machine) for machine in session.machines.values()} == {1, 2}


def test_doing_nothing_for_five_seconds_is_a_pause_and_notes_do_not_end_it(
    log: SessionLog,
) -> None:
    log.append(Action(at=4.9, do="add", machine=TWO))  # no pause before it
    log.append(Note(at=8.0, text="thinking"))
    log.append(Action(at=10.9, do="watch", machine=TWO))
    log.append(StudioTest(at=11.0, seconds=20.0, machine=TWO, score=None, status="timeout"))
    log.append(End(at=36.0, reason="time"))
    pauses = read_session(log.path).of(Pause)
    assert [(pause.at, pause.seconds) for pause in pauses] == [(5.9, 5.0), (31.0, 5.0)]


def test_events_are_in_the_order_of_time(log: SessionLog) -> None:
    log.append(Action(at=3.0, do="add", machine=TWO))
    log.append(StudioTest(at=1.0, seconds=4.0, machine=ROOT, score=0, status="ok"))
    assert [event.at for event in read_session(log.path).events] == [1.0, 3.0]


def test_a_session_that_was_cut_off_keeps_its_whole_lines(log: SessionLog) -> None:
    log.append(Note(at=1.0, text="one"))
    with (log.path / FILE).open("ab") as file:
        file.write(b'{"kind": "note", "at": 2')
    assert [note.text for note in read_session(log.path).of(Note)] == ["one"]


def test_nothing_is_written_after_the_end(log: SessionLog) -> None:
    log.finish("left")
    log.finish("left")
    with pytest.raises(UsageError, match="this session is over"):
        log.append(Note(at=1.0, text="late"))
    assert len(read_session(log.path).of(End)) == 1


def test_a_folder_holds_one_session(log: SessionLog) -> None:
    with pytest.raises(UsageError, match="holds a session already"):
        SessionLog.begin(log.path, SessionStart(task="throwing", machine=ROOT))


@pytest.mark.parametrize(
    ("line", "problem"),
    [
        ('{"kind": "dance", "at": 1}', "line 2: the line"),
        ('{"kind": "note", "at": -1, "text": "a"}', "line 2: note.at: must be"),
        ('{"kind": "note", "at": 1, "text": "a", "mood": "good"}', "note.mood"),
        ('{"kind": "action", "at": 1, "do": "paint", "machine": [{"id": 0}]}', "action.do"),
        ('{"kind": "audio", "at": 1, "file": "../speech.webm"}', "audio.file"),
        ("not JSON", "line 2: the line"),
    ],
)
def test_a_damaged_line_is_named(log: SessionLog, line: str, problem: str) -> None:
    with (log.path / FILE).open("a") as file:
        file.write(line + "\n")
    with pytest.raises(RunError) as caught:
        read_session(log.path)
    assert problem in str(caught.value)


def test_machines_keep_their_control_programs(log: SessionLog) -> None:
    wheel = {"type": 2, "id": 2, "parent": 1, "face_id": 1}
    program = {"blocks": [2], "at": 0.5, "for": 2, "level": -0.5}
    written = {"blocks": [*TWO, wheel], "controls": [program]}
    log.append(Action(at=4.0, do="add", machine=written))
    session = read_session(log.path)
    assert session.machine(session.of(Action)[0]).to_json() == written


def test_a_machine_that_is_none_is_named_with_its_time(log: SessionLog) -> None:
    log.append(Action(at=4.0, do="add", machine=[{"id": 0}]))
    with pytest.raises(RunError, match=r"damaged: the machine at 4\.0 s: "):
        _ = read_session(log.path).machines


def test_what_is_no_session_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RunError, match=r"is not a session: it has no session\.jsonl"):
        read_session(tmp_path)
    (tmp_path / FILE).touch()
    with pytest.raises(RunError, match="is empty"):
        read_session(tmp_path)
    (tmp_path / FILE).write_text('{"kind": "session", "format": 2}\n')
    with pytest.raises(RunError, match="line 1: format: expected 1"):
        read_session(tmp_path)
