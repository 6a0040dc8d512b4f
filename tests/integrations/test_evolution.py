"""The evaluator, as the libraries call it that evolve texts: GEPA, OpenEvolve and
ShinkaEvolve as installed."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

import agentflow
from agentflow.env.tasks.records import record_machine, record_of
from agentflow.env.tasks.registry import get_task
from agentflow.errors import UsageError
from tests.integrations.foreign import CAR, documented_code, offer_examples, run_foreign
from tests.llm.foreign import ROOT

pytestmark = [pytest.mark.slow, pytest.mark.timeout(300)]

ENVIRONMENT = ".venv-evolution"
EVOLVE = """
import asyncio, json, sys
from pathlib import Path
from openevolve.config import EvaluatorConfig
from openevolve.evaluator import Evaluator

async def judge():
    config = EvaluatorConfig(cascade_evaluation=True, cascade_thresholds=[0.5, 0.5])
    judge = Evaluator(config, "evaluation.py", suffix=".json")
    return [await judge.evaluate_program(text, "p") for text in sys.argv[1:]]

if __name__ == "__main__":
    print(json.dumps(asyncio.run(judge())))
"""
"""Evaluates texts with OpenEvolve's own evaluator."""
SHINKA = """
import json, sys
from shinka.launch import JobScheduler, LocalJobConfig

if __name__ == "__main__":
    scheduler = JobScheduler("local", LocalJobConfig(eval_program_path="evaluate.py"))
    told = [scheduler.run(name, f"results-{name}")[0] for name in sys.argv[1:]]
    print(json.dumps([{key: one[key] for key in ("correct", "metrics")} for one in told]))
"""
"""Evaluates files as ShinkaEvolve does: in a process each, whose files it reads."""


def test_gepa_finds_the_better_of_two_machines(tmp_path: Path) -> None:
    offer_examples(tmp_path)
    told = run_foreign(ENVIRONMENT, tmp_path, "-c", documented_code("gepa"))
    assert CAR.strip() in told


def test_gepa_evolves_instructions_of_designers(tmp_path: Path) -> None:
    example = ROOT / "examples" / "evolve_prompts.py"
    options = ("--engine", "mujoco", "--evaluations", "30")
    told = run_foreign(ENVIRONMENT, tmp_path, example, *options)
    page = (ROOT / "docs" / "integrations" / "gepa.md").read_text(encoding="utf-8")
    [made] = re.findall(r"advice after (\d+) evaluations: (.*)", told)
    assert int(made[0]) >= 10
    assert all(words in made[1] for words in ("powered wheels", "four wheels", "no ballast"))
    [shares] = re.findall(r"unseen items: (\S+) before, (\S+) after", told)
    assert f"In {made[0]} evaluations" in page
    assert "rises from {} to {}".format(*shares) in page


def test_openevolve_checks_then_simulates(tmp_path: Path) -> None:
    (tmp_path / "evaluation.py").write_text(documented_code("openevolve"))
    (tmp_path / "machine.json").write_text(CAR)
    (tmp_path / "evolve.py").write_text(EVOLVE)
    printed = run_foreign(ENVIRONMENT, tmp_path, "evolve.py", CAR, "[]")
    good, bad = json.loads(printed.splitlines()[-1])
    assert good["combined_score"] == agentflow.reward("movement", CAR, engine="mujoco").value
    assert bad.get("combined_score", 0) == 0
    assert bad["valid"] == 0


def test_shinkaevolve_reads_what_is_written(tmp_path: Path) -> None:
    (tmp_path / "evaluate.py").write_text(documented_code("shinkaevolve"))
    (tmp_path / "schedule.py").write_text(SHINKA)
    (tmp_path / "good.json").write_text(CAR)
    (tmp_path / "bad.json").write_text("I would build a car.")
    printed = run_foreign(ENVIRONMENT, tmp_path, "schedule.py", "good.json", "bad.json")
    good, bad = json.loads(printed.splitlines()[-1])
    assert good["correct"] == {"correct": True, "error": None}
    score = agentflow.reward("movement", CAR, engine="mujoco").value
    assert good["metrics"]["combined_score"] == score
    assert "greatest distance" in good["metrics"]["text_feedback"]
    assert not bad["correct"]["correct"]
    assert bad["correct"]["error"]
    assert bad["metrics"] == {}


def test_a_batch_has_the_scores_of_single_calls() -> None:
    evaluator = agentflow.evaluator("movement", workers=1)
    root = json.dumps(json.loads(CAR)[:1])
    [(score, told), (nothing, _)] = evaluator.batch([(CAR, None), ({"machine": root}, None)])
    assert score == evaluator(CAR)[0] == told["scores"]["score"] > 40
    assert nothing < 0.01


def test_one_trial_comes_before_all(tmp_path: Path) -> None:
    record = record_of(get_task("lifting"))
    assert record is not None
    best = record_machine(record.name)
    assert best is not None
    machine = tmp_path / "record.json"
    machine.write_text(best.to_text())
    evaluator = agentflow.evaluator("lifting", workers=1)
    stages = (evaluator.first_trial(machine), evaluator.evaluate(machine))
    assert [stage["metrics"]["combined_score"] for stage in stages] == [1, 10]


def test_an_unknown_task_is_refused() -> None:
    with pytest.raises(UsageError, match="unknown task 'walking'"):
        agentflow.evaluator("walking")
