"""Sessions: what the page tells is recorded with times; the clock stops; only one is open."""

from __future__ import annotations

import base64
import os
from collections.abc import Iterator
from pathlib import Path
from threading import Thread
from typing import Any

import pytest

from agentflow.errors import UsageError
from agentflow.studio.sessions.recorder import FOLDER, SessionRecorder
from agentflow.study.session import (
    Action,
    Audio,
    End,
    Note,
    Pause,
    SessionStart,
    StudioTest,
    read_session,
)
from tests.machine.builders import CAR, build
from tests.studio.serving import Browser, studio

ROOT = [{"type": 0, "id": 0, "parent": -1, "face_id": -1}]
ADDED = {
    "kind": "action",
    "do": "add",
    "block": 1,
    "type": 1,
    "machine": build((1, 0, 0)).to_json(),
}


class Clock:
    """Seconds that a test sets."""

    seconds = 100.0

    def __call__(self) -> float:
        return self.seconds


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def recorder(tmp_path: Path, clock: Clock) -> Iterator[SessionRecorder]:
    with SessionRecorder(tmp_path, clock) as found:
        yield found


def start(**more: Any) -> SessionStart:
    return SessionStart(task="movement", machine=ROOT, **more)


def test_actions_tests_pauses_and_notes_are_recorded_with_their_times(
    recorder: SessionRecorder, clock: Clock, tmp_path: Path
) -> None:
    name = recorder.begin(start(mode="guided", rationale="Begin low."))["session"]
    clock.seconds += 2
    recorder.tell(name, ADDED)
    clock.seconds += 8
    trial = {"machine": CAR.to_json(), "score": 45.9, "status": "ok", "run": "a run"}
    recorder.tell(name, {"kind": "trial", "seconds": 1.5, **trial})
    recorder.tell(name, {"kind": "note", "text": "too slow"})
    clock.seconds += 1
    recorder.end(name)
    found = read_session(tmp_path / FOLDER / name)
    assert (found.start.mode, found.start.rationale) == ("guided", "Begin low.")
    assert found.events == (
        Action(at=2, **{key: value for key, value in ADDED.items() if key != "kind"}),
        Pause(at=3, seconds=5.5),
        StudioTest(at=8.5, seconds=1.5, **trial),
        Note(at=10, text="too slow"),
        End(at=11, reason="finished"),
    )


def test_the_clock_stands_while_the_person_pauses(
    recorder: SessionRecorder, clock: Clock, tmp_path: Path
) -> None:
    name = recorder.begin(start(limit_s=60))["session"]
    clock.seconds += 50
    assert recorder.pause(name, True) == 10
    clock.seconds += 1000
    open_one = recorder.current()
    assert open_one is not None
    assert (open_one["left_s"], open_one["paused"]) == (10, True)
    assert recorder.pause(name, False) == 10
    clock.seconds += 10
    assert recorder.current() is None
    with pytest.raises(UsageError, match="this session is over: its time is up"):
        recorder.tell(name, ADDED)
    events = read_session(tmp_path / FOLDER / name).events
    assert Pause(at=50, seconds=1000, asked=True) in events
    assert events[-1] == End(at=1060, reason="time")


def test_a_session_that_is_left_says_so(tmp_path: Path, clock: Clock) -> None:
    with SessionRecorder(tmp_path, clock) as recorder:
        name = recorder.begin(start())["session"]
    assert read_session(tmp_path / FOLDER / name).of(End) == (End(at=0, reason="left"),)


def test_a_reloaded_page_goes_on_with_the_machine_as_it_was(recorder: SessionRecorder) -> None:
    name = recorder.begin(start())["session"]
    recorder.tell(name, ADDED)
    found = recorder.current()
    assert found is not None
    assert (found["session"], found["machine"]) == (name, ADDED["machine"])


def test_sound_is_kept_beside_the_events(recorder: SessionRecorder, tmp_path: Path) -> None:
    name = recorder.begin(start())["session"]
    for piece, first in ((b"one", True), (b"two", False), (b"again", True)):
        recorder.hear(name, piece, first)
    recorder.end(name)
    folder = tmp_path / FOLDER / name
    heard = [(folder / audio.file).read_bytes() for audio in read_session(folder).of(Audio)]
    assert heard == [b"onetwo", b"again"]


def test_a_link_in_place_of_the_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir()
    os.symlink(tmp_path / "elsewhere", tmp_path / FOLDER)
    recorder = SessionRecorder(tmp_path)
    with pytest.raises(UsageError, match="is a link; sessions must be in a plain folder"):
        recorder.begin(start())
    assert list(recorder.sessions()) == []
    assert list((tmp_path / "elsewhere").iterdir()) == []


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("runs")


@pytest.fixture(scope="module")
def browser(runs: Path) -> Iterator[Browser]:
    with studio(runs) as served:
        yield served.enter()


@pytest.fixture
def opened(browser: Browser) -> Iterator[str]:
    """The name of a session that is open."""
    given = {"task": "movement", "machine": ROOT, "limit_s": 600.0}
    name = browser.post("/api/session/begin", given)["session"]
    yield name
    if browser.get("/api/session"):
        browser.post("/api/session/end", {"session": name})


def test_a_session_is_listed_in_numbers(browser: Browser, opened: str) -> None:
    browser.post("/api/session/event", {"session": opened, "event": ADDED})
    browser.post("/api/session/end", {"session": opened})
    [row] = [row for row in browser.get("/api/sessions") if row["session"] == opened]
    assert (row["task"], row["mode"], row["actions"], row["trials"], row["best"]) == (
        *("movement", "free", 1, 0),
        None,
    )


TESTED = {"kind": "trial", "machine": ROOT, "score": 1, "status": "ok", "seconds": 0}
WRONG: dict[str, dict[str, Any]] = {
    "a pause": {"kind": "pause", "seconds": 5, "asked": True},
    "an end": {"kind": "end", "reason": "finished"},
    "a file": {"kind": "audio", "file": "../speech.webm"},
    "a time": {**ADDED, "at": "yesterday", "seconds": "x"},
    "an unknown deed": {**ADDED, "do": "hack"},
    "no machine": {**ADDED, "machine": [{"type": 1}]},
    "a status": {**TESTED, "status": "won"},
    "a time before now": {**TESTED, "seconds": -1},
    "a time of 400 digits": {**ADDED, "seconds": 10**400},
    "a time before all": {**TESTED, "seconds": -(10**400)},
    "a score of 400 digits": {**TESTED, "score": 10**400},
    "a long note": {"kind": "note", "text": "x" * 10_001},
}


@pytest.mark.parametrize("wrong", WRONG)
def test_events_that_do_not_happen_are_refused(browser: Browser, opened: str, wrong: str) -> None:
    answer = browser.ask("/api/session/event", {"session": opened, "event": WRONG[wrong]})
    assert answer.status_code == 400


@pytest.mark.usefixtures("opened")
@pytest.mark.parametrize("session", ["", "..", "../runs", "another"])
def test_other_sessions_are_not_written(browser: Browser, session: str) -> None:
    given = {"session": session}
    for path, more in (
        ("event", {"event": ADDED}),
        ("sound", {"data": "", "first": True}),
        ("pause", {"paused": True}),
        ("end", {}),
    ):
        assert browser.ask(f"/api/session/{path}", {**given, **more}).status_code == 400


def test_a_limit_of_400_digits_is_refused(browser: Browser) -> None:
    given = {"task": "movement", "machine": ROOT, "limit_s": 10**400}
    assert browser.ask("/api/session/begin", given).status_code == 400
    assert browser.get("/api/session") is None


def test_a_second_tab_cannot_begin_another_session(browser: Browser, opened: str) -> None:
    given = {"task": "movement", "machine": ROOT}
    answer = browser.ask("/api/session/begin", given)
    assert (answer.status_code, "is open in this studio" in answer.text) == (400, True)
    assert browser.get("/api/session")["session"] == opened


def test_two_tabs_that_write_leave_whole_lines(browser: Browser, opened: str, runs: Path) -> None:
    def write() -> None:
        for _ in range(5):
            browser.post("/api/session/event", {"session": opened, "event": ADDED})

    tabs = [Thread(target=write) for _ in range(2)]
    for tab in tabs:
        tab.start()
    for tab in tabs:
        tab.join()
    assert len(read_session(runs / FOLDER / opened).of(Action)) == 10


def test_sound_that_is_not_base64_is_refused(browser: Browser, opened: str) -> None:
    given = {"session": opened, "first": True}
    for wrong in ("<script>", "säng"):
        assert browser.ask("/api/session/sound", {**given, "data": wrong}).status_code == 400
    sound = base64.b64encode(b"\x1aE\xdf\xa3").decode()
    assert browser.ask("/api/session/sound", {**given, "data": sound}).status_code == 200


def test_a_guided_session_needs_a_rationale(browser: Browser) -> None:
    given = {"task": "movement", "machine": ROOT, "mode": "guided", "rationale": " "}
    answer = browser.ask("/api/session/begin", given)
    assert "a guided session shows a rationale" in answer.text


STUDY = {"participant": "P-07", "consent": "Clicks are recorded.", "refine": False}


def test_a_session_of_a_study_needs_consent_and_says_who_takes_part(
    browser: Browser, runs: Path
) -> None:
    given = {"task": "movement", "machine": ROOT, **STUDY}
    answer = browser.ask("/api/session/begin", given)
    assert "once the person has agreed to the consent text" in answer.text
    assert browser.get("/api/session") is None
    assert browser.ask("/api/session/begin", {**given, "participant": "A. Name"}).status_code == 400
    found = browser.post("/api/session/begin", {**given, "agreed": True})
    assert not found["refine"]
    browser.post("/api/session/end", {"session": found["session"]})
    start = read_session(runs / FOLDER / found["session"]).start
    assert {key: getattr(start, key) for key in STUDY} == STUDY


def test_a_session_is_replayed_with_its_machines(browser: Browser, opened: str) -> None:
    for event in (ADDED, {"kind": "note", "text": "too slow"}):
        browser.post("/api/session/event", {"session": opened, "event": event})
    found = browser.get("/api/session/replay", session=opened)
    assert [(event["kind"], event["text"]) for event in found["events"]] == [
        ("action", "added block 1, Wooden Block"),
        ("note", "too slow"),
    ]
    first, last = found["machine"], found["events"][-1]["machine"]
    for digest, blocks in ((first, 1), (last, 2)):
        machine = browser.get("/api/session/machine", session=opened, machine=digest)["machine"]
        assert (len(machine["solids"]), machine["film"]["samples"]) == (blocks, 1)
    for name in ("..", "../sessions", "none", ""):
        answer = browser.client.get("/api/session/replay", params={"session": name})
        assert answer.status_code == 400
    unknown = {"session": opened, "machine": "0" * 16}
    assert browser.client.get("/api/session/machine", params=unknown).status_code == 400
