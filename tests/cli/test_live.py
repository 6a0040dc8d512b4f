"""What is seen of a run while it runs, at any width, on a terminal and in a pipe."""

from __future__ import annotations

import io
import itertools
from dataclasses import replace
from functools import partial
from typing import Any

import pytest
from rich.console import Console

from agentflow.cli.display.live import RunView, sparkline, watch
from agentflow.runs.events import (
    AttemptEvent,
    BeamEvent,
    CallsEvent,
    DrawingEvent,
    RunStartEvent,
    StageBeginEvent,
    StageEvent,
    ToolEvent,
)
from agentflow.runs.locations import Location
from tests.metrics.events import attempt as answered
from tests.metrics.events import candidate, evaluation
from tests.metrics.test_niches import EVENTS as NICHES

Captured = pytest.CaptureFixture[str]

STAGE = StageEvent(
    Location("initial"),
    name="initial",
    trajectories=8,
    parsed_first=8,
    spatial_first=8,
    valid_first=7,
    valid=7,
    mean=12.5,
    mean_all=11.0,
    max=20.0,
    std=1.0,
    calls=2,
    tokens=350,
    rollouts=2,
    expansions=0,
    attempts=0,
    children=0,
)


def attempt(valid: bool, tokens: int, problem: str = "") -> AttemptEvent:
    return answered("designer/traj-1/attempt-1", tokens, valid=valid, problem=problem)


EVENTS = (
    RunStartEvent(Location("start"), "throwing", "iterative", "a model"),
    StageBeginEvent(Location("initial"), 8),
    CallsEvent(Location.parse("designer/traj-1/attempt-1"), 3, 0.01234),
    attempt(False, 100, "The reply holds no [bold]machine[/bold]:\n- nothing [bold]at all[/bold]"),
    attempt(True, 250),
    BeamEvent(Location(structure=1), ("00",)),
    evaluation("initial/traj-1", 12.5),
    evaluation("initial/traj-2", None, status="timeout"),
    candidate("initial", 1, 12.5),
    STAGE,
)


REFUSED = ToolEvent(
    Location("initial", call=7), "check", {}, refused=True, answer="Not valid:\n- [bold]overlap"
)


def seen(live_view: RunView, width: int, **options: Any) -> list[str]:
    """The lines of the view in a terminal of a width."""
    file = io.StringIO()
    console = Console(file=file, width=width, force_terminal=True, no_color=True, **options)
    console.print(live_view.draw())
    return [line.rstrip() for line in file.getvalue().splitlines()]


@pytest.fixture
def live_view() -> RunView:
    view = RunView()
    for event in EVENTS:
        view.note(event)
    view.started += 1e9  # so that the clock shows a number that does not change the width
    return view


def test_the_archive_of_a_search_is_counted(live_view: RunView) -> None:
    assert not any(line.startswith("archive") for line in seen(live_view, 100))
    for event in NICHES:
        live_view.note(event)
    told = "archive: 3 of 8 cells, QD score 10.00, mechanism classes: 2"
    assert told in seen(live_view, 100)


def plain(lines: list[str]) -> list[str]:
    return ["".join(part.partition("m")[2] for part in f"m{line}".split("\x1b[")) for line in lines]


def test_the_view_says_what_is_going_on(live_view: RunView) -> None:
    lines = plain(seen(live_view, 100))
    assert lines[0] == "throwing · iterative · a model"
    assert lines[1].startswith("initial · 8 trajectories · 2 evaluations · ")
    assert lines[2] == "2 calls, 3 in progress, 50% valid · 350 tokens · cost 0.01234"
    assert lines[3] == "best 12.50  ██"
    assert lines[4].split() == ["stage", "valid", "mean", "best"]
    assert lines[5].split() == ["initial", "7/8", "12.50", "20.00"]
    assert lines[6] == "designer/traj-1/attempt-1: nothing [bold]at all[/bold]"


@pytest.mark.parametrize("width", [20, 44, 80, 200])
def test_the_view_fits_any_width(live_view: RunView, width: int) -> None:
    lines = plain(seen(live_view, width))
    assert all(len(line) <= width for line in lines)
    assert len(lines) == 7


def test_nothing_known_is_shown_as_such() -> None:
    lines = plain(seen(RunView(), 80))
    assert lines[0] == "starting"
    assert lines[1].startswith("waiting · 0 trajectories · 0 evaluations · ")
    assert lines[3] == "best -"


def test_an_unknown_cost_is_unknown(live_view: RunView) -> None:
    live_view.note(CallsEvent(Location("x"), 0, None))
    assert "cost unknown" in plain(seen(live_view, 100))[2]
    live_view.note(DrawingEvent())
    assert plain(seen(live_view, 100))[1].startswith("drawing pictures · ")
    live_view.note(DrawingEvent(frames=(120, 300)))
    assert plain(seen(live_view, 100))[1].startswith("drawing pictures, frame 120 of 300 · ")


def test_the_curve_keeps_to_its_width() -> None:
    assert sparkline([]) == ""
    assert sparkline([0.0, 0.0]) == "▁▁"
    assert sparkline([0.0, 1.0, 2.0]) == "▁▄█" or sparkline([0.0, 1.0, 2.0]) == "▁▅█"
    assert len(sparkline([float(i) for i in range(1000)])) == 40


def test_without_a_terminal_there_is_one_line_per_event(capsys: Captured) -> None:
    with watch(quiet=False) as (listener, say):
        assert listener is not None
        for event in (*EVENTS, DrawingEvent(), DrawingEvent(frames=(1, 2))):
            listener(event)
        say("a remark")
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.splitlines() == [
        "throwing, iterative, a model",
        "stage initial begins",
        "stage initial: 7 of 8 machines valid, mean 12.50, best 20.00",
        "drawing pictures",
        "agentflow: a remark",
    ]


def test_a_pipe_gets_few_lines_however_much_happens(
    capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("time.monotonic", partial(next, itertools.count(0.0, 0.1)))
    with watch(quiet=False) as (listener, _say):
        assert listener is not None
        for event in (EVENTS[0], *EVENTS[3:8] * 100):
            listener(event)
    lines = capsys.readouterr().err.splitlines()
    assert 2 <= len(lines) < 10
    assert "calls, " in lines[-1]
    assert "best 12.50" in lines[-1]


def test_calls_are_told_of_about_how_many(
    live_view: RunView, capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    live_view.expected = 250
    assert plain(seen(live_view, 100))[2].startswith("2 of about 250 calls, 3 in progress")
    monkeypatch.setattr("time.monotonic", partial(next, itertools.count(0.0, 40.0)))
    with watch(quiet=False, calls=2) as (listener, _say):
        assert listener is not None
        for event in (EVENTS[0], EVENTS[2], *EVENTS[3:5], attempt(True, 1)):
            listener(event)
    lines = capsys.readouterr().err.splitlines()
    assert lines[1] == "waiting for the first reply"
    assert any(line.startswith("1 of about 2 calls, ") for line in lines)
    assert lines[-1].startswith("3 calls, ")  # an estimate that is reached is told no more


def test_a_run_that_asks_no_model_waits_for_no_reply(
    capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("agentflow.cli.display.live.EVERY_S", 0.0)
    with watch(quiet=False) as (listener, _say):
        assert listener is not None
        for event in EVENTS:
            if event.kind != "attempt":
                listener(event)
    told = capsys.readouterr().err.partition("0 calls, 1 simulation, best ")
    assert told[1]
    assert "waiting for the first reply" not in told[2]


def test_what_a_model_wrote_does_not_reach_the_terminal_raw(
    live_view: RunView, capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    evil = attempt(False, 1, "\x1b]0;title\x07\x1b[2J\u202e\rgone")
    live_view.note(evil)
    assert plain(seen(live_view, 100))[-1] == (
        r"designer/traj-1/attempt-1: \x1b]0;title\x07\x1b[2J\u202e\rgone"
    )
    monkeypatch.setattr("agentflow.cli.display.live.EVERY_S", 0.0)
    with watch(quiet=False) as (listener, _say):
        assert listener is not None
        listener(evil)
    assert capsys.readouterr().err.endswith("\\u202e\\rgone\n")


def test_quiet_leaves_nothing(capsys: Captured) -> None:
    with watch(quiet=True) as (listener, say):
        assert listener is None
        say("a remark")
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    ("code", "parsed", "problem", "shown"),
    [
        ("truncated", False, "It was cut off at the length limit. Send a shorter one", "cut-off"),
        ("tool_calls", False, "It only called tools, but there are none.", "empty reply"),
        ("content_filter", False, "Put it in other words", "filtered reply"),
        ("not_json", False, "no JSON list found; write the whole machine", "no JSON list found"),
        (
            "overlap",
            True,
            "The machine is not valid:\n- block 3 overlaps block 5; move it",
            "block 3",
        ),
    ],
)
def test_progress_gives_the_reason_of_a_refused_reply_in_words_for_people(
    code: str,
    parsed: bool,
    problem: str,
    shown: str,
    capsys: Captured,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("agentflow.cli.display.live.EVERY_S", 0.0)
    event = answered("designer/traj-1/attempt-1", 3, valid=False, problem=problem)
    refused = replace(event, code=code, parsed=parsed)
    with watch(quiet=False) as (listener, _):
        assert listener is not None
        listener(refused)
    (line,) = capsys.readouterr().err.splitlines()
    assert f"; refused designer/traj-1/attempt-1: {shown}" in line
    assert "Send" not in line
    assert "Put" not in line
    assert "write" not in line


def test_refused_calls_of_tools_on_a_terminal() -> None:
    live_view = RunView()
    live_view.note(REFUSED)
    assert "initial/call-7: check: Not valid:" in "\n".join(seen(live_view, 80))
