"""The evaluator, as the libraries call it that evolve texts: GEPA and OpenEvolve as installed."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import agentflow
from agentflow.errors import UsageError
from agentflow.integrations.evolution import Evaluator
from tests.integrations.foreign import CAR, documented_code, run_foreign

pytestmark = [pytest.mark.slow, pytest.mark.timeout(300)]

ENVIRONMENT = ".venv-evolution"
EVOLVE = """
import asyncio, json, sys
from pathlib import Path
from openevolve.config import EvaluatorConfig
from openevolve.evaluator import Evaluator

async def judge():
    config = EvaluatorConfig(cascade_evaluation=True, cascade_thresholds=[0.5])
    judge = Evaluator(config, "evaluation.py", suffix=".json")
    return [await judge.evaluate_program(text, "p") for text in sys.argv[1:]]

if __name__ == "__main__":
    print(json.dumps(asyncio.run(judge())))
"""


def test_gepa_finds_the_better_of_two_machines(tmp_path: Path) -> None:
    (tmp_path / "examples").mkdir()
    (tmp_path / "examples" / "car.json").write_text(CAR)
    told = run_foreign(ENVIRONMENT, tmp_path, "-c", documented_code("GEPA"))
    assert CAR.strip() in told


def test_openevolve_checks_then_simulates(tmp_path: Path) -> None:
    code = documented_code("OpenEvolve and ShinkaEvolve")
    (tmp_path / "evaluation.py").write_text(code)
    (tmp_path / "machine.json").write_text(CAR)
    (tmp_path / "evolve.py").write_text(EVOLVE)
    good, bad = json.loads(
        run_foreign(ENVIRONMENT, tmp_path, "evolve.py", CAR, "[]").splitlines()[-1]
    )
    assert good["combined_score"] == agentflow.reward("movement", CAR, engine="mujoco").value
    assert bad.get("combined_score", 0) == 0
    assert bad["valid"] == 0


def test_files_of_shinkaevolve(tmp_path: Path) -> None:
    machine = tmp_path / "car.json"
    for text, correct in ((CAR, True), ("I would build a car.", False)):
        machine.write_text(text)
        Evaluator("movement", workers=1).write(machine, tmp_path)
        told = json.loads((tmp_path / "correct.json").read_text())
        metrics = json.loads((tmp_path / "metrics.json").read_text())
        assert told["correct"] is correct
        assert bool(told["error"]) is not correct
        assert ("combined_score" in metrics) is correct
    with pytest.raises(UsageError, match="unknown task 'walking'"):
        Evaluator("walking")
