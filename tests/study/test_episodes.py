"""Episodes of the session made by hand, cut and labelled by rules; transcripts."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agentflow.errors import UsageError
from agentflow.study.episodes import ALLOWED, MEANING, Utterance, cut, read_transcript
from agentflow.study.segments import label_by_rules
from agentflow.study.session import Action, Pause, Session, SessionStart, StudioTest
from tests.machine.builders import build
from tests.study.example import FOUR_WHEELS, HINGED, TRANSCRIPT, TWO_WHEELS, record


@pytest.fixture
def session(tmp_path: Path) -> Session:
    return record(tmp_path)


@pytest.fixture
def said(tmp_path: Path) -> tuple[Utterance, ...]:
    file = tmp_path / "said.vtt"
    file.write_text(TRANSCRIPT)
    return read_transcript(file)


def labelled(session: Session, said: tuple[Utterance, ...] = ()) -> list[tuple[object, ...]]:
    episodes = label_by_rules(session, cut(session, said))
    return [(one.begin, one.end, one.coarse, one.label) for one in episodes]


def test_rules_on_actions_label_every_episode_but_breaks(session: Session) -> None:
    assert labelled(session) == [
        (0, 10, "pause", "Plan"),  # nothing is built yet
        (10, 17, "building", "Build"),
        (17, 22, "testing", "Test"),
        (22, 23, "looking", "Observe"),
        (23, 33, "pause", "Observe"),  # a score of 4 is no failure
        (33, 38, "building", "Revise"),  # more wheels, the same mechanism
        (38, 40, "testing", "Test"),
        (40, 47, "pause", "Diagnose"),  # 3 is less than 4
        (47, 50, "building", "Restructure"),  # begun anew, with a hinge
        (50, 51, "testing", "Test"),
        (51, 54, "break", None),
        (54, 60, "pause", "Reflect"),  # nothing is done any more
    ]


def test_speech_cuts_pauses_only(session: Session, said: tuple[Utterance, ...]) -> None:
    assert [one for one in labelled(session, said) if one[2] in ("pause", "talking")] == [
        (0, 10, "pause", "Plan"),
        (23, 26, "talking", "Observe"),  # a second of silence before it is no pause
        (26, 33, "pause", "Hypothesize"),
        (40, 47, "talking", "Diagnose"),  # nor are three seconds after it
        (54, 60, "pause", "Reflect"),
    ]


TIMES = st.integers(0, 60).map(float)
MACHINES = st.sampled_from([build(), TWO_WHEELS, FOUR_WHEELS, HINGED]).map(lambda m: m.to_json())
EVENTS = st.one_of(
    st.builds(Action, at=TIMES, do=st.sampled_from(["add", "watch", "ask"]), machine=MACHINES),
    st.builds(
        StudioTest,
        at=TIMES,
        seconds=TIMES,
        machine=MACHINES,
        score=st.sampled_from([None, 0.0, 3.0, 4.0]),
        status=st.just("ok"),
    ),
    st.builds(Pause, at=TIMES, seconds=TIMES, asked=st.booleans()),
)
SAID = st.builds(Utterance, begin=TIMES, end=st.just(30.0), text=st.just("so"))


@pytest.mark.slow
@given(st.lists(EVENTS, max_size=8), st.lists(SAID, max_size=3))
def test_episodes_cover_any_session_and_have_allowed_labels(
    events: list[Action | StudioTest | Pause], said: list[Utterance]
) -> None:
    ordered = tuple(sorted(events, key=lambda event: event.at))
    start = SessionStart(task="movement", machine=build().to_json())
    session = Session(Path("one"), start, ordered)
    episodes = label_by_rules(session, cut(session, sorted(said, key=lambda one: one.begin)))
    ends = [one.end for one in episodes]
    assert all(a.coarse != b.coarse for a, b in pairwise(episodes))
    assert [one.begin for one in episodes] == [0.0, *ends][: len(episodes)]
    assert ends == sorted(set(ends))
    assert ends[-1:] == [session.seconds] * bool(events and session.seconds)
    assert all(one.label in (*ALLOWED[one.coarse], None) for one in episodes)
    assert all(one.label is not None for one in episodes if one.coarse != "break")


def test_every_label_has_a_meaning_and_an_episode_that_may_have_it() -> None:
    assert {label for allowed in ALLOWED.values() for label in allowed} == set(MEANING)
    assert len(MEANING) == 10


def test_transcripts_are_read_without_notes_and_tags(
    said: tuple[Utterance, ...], tmp_path: Path
) -> None:
    assert [(one.begin, one.end, one.text) for one in said] == [
        (24.0, 26.0, "It turns because only one side drives."),
        (41.5, 44.0, "The hinge should hold the car straight."),
    ]
    file = tmp_path / "said.srt"
    file.write_text(
        "1\n00:00:03,250 --> 00:00:04,000\nTwo\nlines\n\n2\n01:00:00,000 --> 01:00:01,000\n"
    )
    (only,) = read_transcript(file, shift=2.0)
    assert (only.begin, only.end, only.text) == (5.25, 6.0, "Two lines")


def test_a_text_without_times_is_no_transcript(tmp_path: Path) -> None:
    file = tmp_path / "said.txt"
    file.write_text("It turns.")
    with pytest.raises(UsageError, match="has no line like 00:01:02"):
        read_transcript(file)
    file.write_bytes(b"\xff\xfe")
    with pytest.raises(UsageError, match="expected text in UTF-8"):
        read_transcript(file)
    with pytest.raises(UsageError, match="cannot read"):
        read_transcript(tmp_path / "none.vtt")
