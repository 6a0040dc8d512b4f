"""The last line of a run that did not go all the way."""

from __future__ import annotations

from typing import Any

import pytest

from agentflow.cli.display.show import ending_of, show_result


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


def test_the_next_command_holds_where_a_folder_has_spaces(
    capsys: pytest.CaptureFixture[str],
) -> None:
    told = {"score": None, "model": "m", "calls": 1, "tokens": 0, "rollouts": 0, "seconds": 1.0}
    changes = {"valid": False, "reason": "none", "stages": [], "run": "my runs/one"}
    show_result(_result(**told, **changes), {})
    line = "see every step in 3D: agentflow report 'my runs/one'"
    assert line in capsys.readouterr().out.splitlines()
