"""Settings of searches end to end: resumed, replayed, with several models, and with bad budgets."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from agentflow.app.design.replay import replay
from agentflow.app.design.run import RunOptions, design, resume
from agentflow.cli import main
from agentflow.config.run import build_config
from agentflow.runs import read_document, read_result
from tests.app.test_doctor import threaded
from tests.llm.hostile import reply
from tests.models.test_clients import CAR

CONFIG: dict[str, Any] = {
    "task": "movement",
    "knobs": {"window": 1},
    "workers": 1,
    "verify": False,
    "settings": {
        "trajectories": 2,
        "max_simulations": 12,
        "local_trials": 1,
        "inspirations": 1,
        "lessons": True,
        "analyst": True,
        "another_mechanism": True,
        "novelty": False,
        "models": ["procedural"],
        "emitters": ["refiner", "edit", "crossover"],
        "search": {"strategy": "ab-mcts", "rounds": 2},
    },
}
Captured = pytest.CaptureFixture[str]


def ignore(_line: str) -> None:
    """No remarks."""


@pytest.mark.slow
@pytest.mark.parametrize("workflow", ["hierarchical", "iterative", "single"])
def test_all_settings_resume_and_replay(workflow: str, tmp_path: Path) -> None:
    config = build_config({**CONFIG, "workflow": workflow})
    first = design(config, tmp_path, RunOptions(ignore), "whole")
    assert replay(tmp_path / "whole", ignore) is None
    cut = tmp_path / "cut"
    shutil.copytree(tmp_path / "whole", cut)
    (cut / "result.json").unlink()
    for name in ("calls.jsonl", "events.jsonl"):
        lines = (cut / name).read_bytes().splitlines(keepends=True)
        (cut / name).write_bytes(b"".join(lines[: len(lines) // 2]))
    again = resume(cut)
    for key in ("score", "machine", "stages", "calls", "rollouts", "makers"):
        assert getattr(again, key) == getattr(first, key), key
    assert replay(cut, ignore) is None


@pytest.mark.slow
def test_a_run_asks_two_models_at_one_endpoint(tmp_path: Path) -> None:
    settings = CONFIG["settings"] | {"models": ["procedural", "m"], "analyst": False}
    document = {**CONFIG, "workflow": "iterative", "settings": settings | {"local_trials": 0}}
    answers = [reply(f"```json\n{CAR}\n```")] * 60
    with threaded(*answers) as server:
        own = {"model": {"base_url": server.base_url}}
        result = design(build_config({**document, **own}), tmp_path, RunOptions(ignore), "two")
    made = {item.maker: item.machines for item in result.makers or ()}
    assert made["designer (m)"] > 0
    assert made["designer (procedural)"] > 0
    assert "model-as-answered" not in result.model
    assert result.model.endswith("; m (designer, refiner)")
    assert replay(tmp_path / "two", ignore) is None


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ("--rollouts=0", "greater than or equal to 1"),
        ("--rollouts=-1", "greater than or equal to 1"),
        ("--rollouts=many", "should be a valid integer"),
        ("--set=max_simulations=0", "settings.max_simulations: must be at least 1, not 0"),
        ("--set=max_simulations=-1", "settings.max_simulations: must be at least 1, not -1"),
        ("--set=max_simulations=many", "settings.max_simulations: expected a whole number"),
        ("--set=local_trials=10000000", "settings.local_trials: must be at most 1000"),
        ("--set=models=['']", "settings.models.0: "),
        ("--set=models=7", "settings.models: "),
        ("--set=emitters=[designer]", "settings.emitters.0: expected 'edit', 'crossover' or"),
        ("--set=search.strategy=best", "unknown search strategy 'best'"),
    ],
)
def test_wrong_budgets_are_refused_in_one_sentence(
    given: str, told: str, tmp_path: Path, capsys: Captured
) -> None:
    assert main(["design", "--task", "movement", "--out", str(tmp_path / "r"), given]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert told in said
    assert said.count("agentflow: ") == 1
    assert not (tmp_path / "r").exists()


@pytest.mark.slow
def test_a_budget_of_ten_million_ends_when_nothing_new_is_found(tmp_path: Path) -> None:
    settings = {"trajectories": 2, "max_simulations": 10**7, "search": {"strategy": "independent"}}
    config = build_config({**CONFIG, "workflow": "iterative", "settings": settings})
    options = RunOptions(ignore)
    with threaded(*[reply(f"```json\n{CAR}\n```")] * 60) as server:
        model = {"name": "m", "base_url": server.base_url}
        result = design(config.model_copy(update={"model": build_config({"model": model}).model}),
                        tmp_path, options, "long")  # fmt: skip
    assert result.rollouts == 1


def test_a_resumed_run_takes_no_other_budget(tmp_path: Path, capsys: Captured) -> None:
    assert main(["design", "--resume", str(tmp_path), "--rollouts", "9"]) == 2
    assert "remove the other options: --rollouts" in capsys.readouterr().err
    assert main(["design", "--resume", str(tmp_path), "--set", "max_simulations=9"]) == 2
    assert "remove the other options: --set" in capsys.readouterr().err


@pytest.mark.slow
def test_a_strategy_that_does_not_fit_is_named(tmp_path: Path) -> None:
    said: list[str] = []
    settings = {"trajectories": 1, "emitters": ["edit"], "search": {"rounds": 0}}
    settings["search"] = {"rounds": 0, "strategy": "ab-mcts"}
    config = build_config({**CONFIG, "workflow": "single", "settings": settings})
    design(config, tmp_path, RunOptions(said.append), "run")
    told = "emitters and search.strategy change nothing in the workflow single, as configured"
    assert told in said
    assert read_document(tmp_path / "run")["config"]["settings"]["emitters"] == ["edit"]
    assert (
        json.loads((tmp_path / "run" / "result.json").read_text())["score"]
        == read_result(tmp_path / "run").score
    )
