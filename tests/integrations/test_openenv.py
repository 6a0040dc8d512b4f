"""OpenEnv, as installed: its server and its clients on loopback."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import agentflow
from agentflow.runs import read_result
from tests.integrations.foreign import CAR, PLUGINS, documented_code, offer_examples, run_foreign
from tests.llm.foreign import ROOT

pytestmark = [pytest.mark.slow, pytest.mark.timeout(300)]


@pytest.mark.mujoco
def test_sessions_on_a_server(tmp_path: Path) -> None:
    script = Path(__file__).with_name("openenv_session.py")
    example = ROOT / "examples" / "openenv"
    offer_examples(tmp_path)
    arguments = (
        "-P",
        script,
        CAR,
        example,
        documented_code("openenv"),
    )  # -P: beside the script is a package `mcp`
    printed = run_foreign(
        ".venv-openenv", tmp_path, *arguments, variables={"PYTHONPATH": str(PLUGINS)}
    )
    found = json.loads(printed.splitlines()[-1])

    played = found["played"]
    assert "no design has begun; call reset first" in played["early"]
    unknown, option = played["wrong"]
    assert "unknown task 'walking'" in unknown
    assert "reset has no option 'level'" in option
    assert {"check", "simulate", "submit"} <= {*played["tools"]}
    assert "Task: movement" in played["brief"]
    assert played["before"] is None
    assert "the tool 'fly' does not exist" in played["refused"]
    assert played["done"] == [False, True, True]
    assert played["reward"] == agentflow.reward("movement", CAR, engine="mujoco").value
    assert "ended" in played["late"]
    assert played["state"]["step_count"] == 4
    assert json.loads(played["state"]["submitted"]) == json.loads(CAR)

    done, reward, text = found["crashed"]
    assert (done, reward) == (True, None)
    assert "no score (crashed)" in text

    met = found["met"]
    assert "100/100 sessions active" in met["full"]
    assert met["seeds"] == list(range(100))
    assert met["known"] == 2  # only those who made it know the machine
    assert met["free"] == 100  # also those of clients that were killed, some while simulating
    results = [read_result(run) for run in (tmp_path / "runs").iterdir()]
    assert len(results) == 5  # of all who made a machine
    assert sum(result.score is not None for result in results) >= 1

    [issue] = found["issues"]
    assert "uv.lock" in issue  # which `uv lock` makes
