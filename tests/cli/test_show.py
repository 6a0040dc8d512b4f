"""The last line of a run that did not go all the way."""

from __future__ import annotations

from typing import Any

import pytest

from agentflow.cli.display.show_machines import marginal_line, show_rollout
from agentflow.cli.display.show_runs import ending_of, show_makers, show_result, show_tools

Captured = pytest.CaptureFixture[str]


def _stage(name: str, valid: int, attempts: int = 0, children: int = 0) -> dict[str, Any]:
    return {"name": name, "valid": valid, "attempts": attempts, "children": children}


def _result(**changes: Any) -> dict[str, Any]:
    stages = [_stage("initial", 2), _stage("env_feedback", 1, 4, 1)]
    return {"valid": True, "stopped": None, "reason": "", "stages": stages, **changes}


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({}, ""),
        (
            {"stopped": "budget"},
            "stopped early: budget limit reached; the result is the best so far",
        ),
        (
            {"stopped": "budget", "valid": False, "reason": "no valid machine: ..."},
            "stopped early: budget limit reached; no valid machine was found",
        ),
        (
            {"valid": False, "reason": "no valid machine: no valid blueprint:\n- it lacks a key"},
            "no valid machine: no valid blueprint: - it lacks a key",
        ),
        (
            {"stages": [_stage("initial", 2), _stage("blind_refinement", 0)]},
            "ended early: no machine in stage blind_refinement was valid",
        ),
        (
            {"stages": [_stage("initial", 2), _stage("env_feedback", 2, 40)]},
            "none of the 40 refinements in stage env_feedback was valid",
        ),
    ],
)
def test_ending(changes: dict[str, Any], expected: str) -> None:
    assert ending_of(_result(**changes)) == expected


def test_the_next_command_holds_where_a_folder_has_spaces(capsys: Captured) -> None:
    told = {"score": None, "model": "m", "calls": 1, "tokens": 0, "rollouts": 0, "seconds": 1.0}
    changes = {"valid": False, "reason": "none", "stages": [], "run": "my runs/one"}
    show_result(_result(**told, **changes), {})
    line = "see every step in 3D: agentflow report 'my runs/one'"
    assert line in capsys.readouterr().out.splitlines()


def test_a_rollout_with_marginal_connections_names_them(capsys: Captured) -> None:
    facts = {"status": "ok", "score": 1.0, "blocks": None, "problems": [], "feedback": "Score: 1"}
    facts["engine"] = None
    named = {"block": 3, "partner": 1, "time": 0.25, "load": 0.97}
    show_rollout({**facts, "marginal": [named]})
    last = "marginal: block 3 off block 1 nearly broke (97 % of its strength, 0.25 s)"
    assert capsys.readouterr().out.splitlines() == ["ok, score 1.00", "Score: 1", last]
    show_rollout({**facts, "marginal": []})
    assert capsys.readouterr().out.splitlines() == ["ok, score 1.00", "Score: 1"]


def test_the_marginal_connections_nearest_to_their_strength_are_named() -> None:
    loads = ((9, 8, 0.52, 0.968), (3, 1, 0.61, 1.004), (4, 1, 0.7, 0.951), (5, 2, -0.1, 1.03))
    found = [dict(zip(("block", "partner", "time", "load"), row, strict=True)) for row in loads]
    assert marginal_line(found[:2]) == (
        "marginal: block 3 off block 1 only just broke (100 % of its strength, 0.61 s); "
        "block 9 off block 8 nearly broke (97 % of its strength, 0.52 s)"
    )
    assert marginal_line(found).endswith(
        "block 5 off block 2 only just broke "
        "(103 % of its strength, -0.10 s); block 9 off block 8 nearly broke "
        "(97 % of its strength, 0.52 s); and 1 more"
    )


def test_calls_of_tools_are_shown_by_stage(capsys: Captured) -> None:
    check, edit = {"calls": 9, "refused": 2}, {"calls": 3, "refused": 0}
    show_tools(
        [
            {"name": "initial", "tools": {"check": check}},
            {"name": "env_feedback", "tools": {"check": edit, "edit": edit}},
        ]
    )
    assert [line.rstrip() for line in capsys.readouterr().out.splitlines()] == [
        "tool   initial        env_feedback",
        "check  9 (2 refused)  3",
        "edit   -              3",
    ]
    show_tools([{"name": "initial"}])
    assert capsys.readouterr().out == ""


def test_a_connection_that_is_marginal_in_several_trials_is_told_once() -> None:
    found = [
        {"block": 3, "partner": 1, "load": load, "time": time}
        for load, time in ((0.97, 0.5), (0.99, 0.6), (1.03, 0.7))
    ]
    told = "marginal: block 3 off block 1 nearly broke (99 % of its strength, 0.60 s)"
    assert marginal_line(found) == told


def test_who_made_the_machines_of_a_search(capsys: Captured) -> None:
    made = {"maker": "refiner", "machines": 20, "share": 0.25, "better": 4, "gain": 12.345}
    show_makers({"makers": [made]})
    show_makers({})
    head, row = capsys.readouterr().out.splitlines()
    assert head.split() == ["made", "by", "machines", "share", "better", "gain"]
    assert row.split() == ["refiner", "20", "25%", "4", "12.35"]
