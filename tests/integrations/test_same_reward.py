"""The same machine has the same reward on every path, bit for bit.

Libraries in environments of their own are compared with `agentflow.reward` in their tests.
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import agentflow
from agentflow.cli import main
from agentflow.integrations.evolution import Evaluator
from agentflow.integrations.harbor import export, items_of
from agentflow.integrations.trl import bench_environment, simulation_reward
from agentflow.integrations.verl import compute_score
from agentflow.runs import read_result
from tests.integrations.foreign import CAR
from tests.integrations.test_harbor import read_reward, run_script

pytestmark = [pytest.mark.slow, pytest.mark.mujoco]

NAME = "6c45a9a7"
"""What the tools call the car."""
ENGINE = "mujoco"
SETTINGS = ("engine=mujoco", "verify=false", "workers=1")


def test_every_path_gives_the_same_reward(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "machine.json").write_text(CAR)
    expected = agentflow.reward("movement", CAR, engine=ENGINE).value
    found = {"simulate": agentflow.simulate(json.loads(CAR), "movement", engine=ENGINE).score}

    command = ["simulate", "machine.json", "--task", "movement", "--engine", ENGINE, "--json"]
    assert main(command) == 0
    found["command"] = json.loads(capsys.readouterr().out)["score"]

    settings = [word for setting in SETTINGS for word in ("--set", setting)]
    assert main(["bench", "start", "--task", "movement", "--name", "car", *settings]) == 0
    assert main(["bench", "check", "@machine.json"]) == 0
    assert main(["bench", "submit", NAME]) == 0
    found["shell"] = read_result(tmp_path / "runs" / "car").score

    export(items_of(["movement"]), tmp_path, engine=ENGINE)
    test = tmp_path / "movement-1" / "tests" / "test.sh"
    assert run_script(test, tmp_path, tmp_path / "logs").returncode == 0
    found["harbor"] = read_reward(tmp_path / "logs")["reward"]

    evaluator = Evaluator("movement", engine=ENGINE, workers=1)
    found["gepa"] = evaluator(CAR)[0]
    found["openevolve"] = evaluator.evaluate("machine.json")["metrics"]["combined_score"]

    [found["trl"]] = simulation_reward([CAR], "movement", engine=ENGINE, workers=1)
    found["verl"] = compute_score("machines", CAR, "movement", engine=ENGINE)["score"]
    environment = bench_environment(engine=ENGINE, workers=1)()
    environment.reset(task="movement")
    environment.check(machine=CAR)
    environment.submit(machine=NAME)
    found["tools"] = environment.get_reward()
    assert found == dict.fromkeys(found, expected)
