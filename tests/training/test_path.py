"""The whole path with a tiny model: data, cold start, GRPO, evaluation, a design."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from agentflow.cli import main
from tests.training.libraries import needs_training

ROOT = Path(__file__).parents[2]
PRESETS = ROOT / "configs" / "train"
LABEL = "tiny model from scratch, procedural data"
SMALL = (
    "model.tiny.hidden=32",
    "model.tiny.layers=1",
    "model.tiny.heads=2",
    "batch=8",
    "steps=4",
    "log_every=1",
)
SHORT = ("steps=2", "prompts=1", "samples=4", "workers=1", "eval_every=2", "eval_samples=2")


def flow(*arguments: object) -> None:
    """Carry out a command, which must succeed."""
    assert main([str(argument) for argument in arguments]) == 0


def settings(*given: str) -> list[str]:
    return [word for setting in given for word in ("--set", setting)]


def read_json(path: Path) -> Any:
    return json.loads(path.read_text(encoding="utf-8"))


@needs_training
@pytest.mark.slow
@pytest.mark.timeout(900)
def test_a_tiny_model_learns_from_scratch_and_designs(tmp_path: Path) -> None:
    answers, pairs = tmp_path / "answers", tmp_path / "set"
    start, improved = tmp_path / "sft-0", tmp_path / "pass1-0"  # names of scripts/learn
    flow("data", "generate", ROOT / "configs" / "objectives.yaml", "--limit", 150, "--out", answers)
    flow("data", "filter", answers, "--out", pairs)
    card = read_json(pairs / "card.json")
    assert card["answers"] == 150
    assert 20 < sum(card["pairs"].values()) < 150  # most answers work, some gates close

    preset = PRESETS / "sft_tiny.yaml"
    flow("train", "sft", "--config", preset, "--data", pairs, "--out", start, *settings(*SMALL))
    curves = [json.loads(line) for line in (start / "curves.jsonl").read_text().splitlines()]
    losses = [row["loss"] for row in curves if "loss" in row]
    assert losses[-1] < losses[0]
    assert read_json(start / "result.json")["label"] == LABEL

    preset, model = PRESETS / "grpo_tiny.yaml", start / "model"
    given = ("--config", preset, "--model", model, "--out", improved)
    flow("train", "grpo", *given, *settings(*SHORT))
    assert read_json(improved / "result.json")["steps"] == 2

    evaluation = tmp_path / "pass1-0.evaluation"
    given = ("--task", "throwing", "--samples", 4, "--workers", 1, "--out", evaluation)
    flow("evaluate", improved / "model", *given)
    measured = read_json(evaluation / "evaluation.json")
    assert measured["label"].startswith("tiny model from scratch")
    assert measured["results"]["throwing"]["replies"] == 4

    runs = tmp_path / "runs"
    given = ("--task", "throwing", "--workflow", "single", "--out", runs, "--quiet")
    flow("design", *given, "--model", improved / "model", *settings("trajectories=1"))
    [run] = runs.iterdir()
    assert read_json(run / "result.json")["model"].startswith("tiny model from scratch")

    page = tmp_path / "page" / "learning.md"
    script = [sys.executable, "benchmarks/learning.py", str(tmp_path), "--page", str(page)]
    subprocess.run(script, cwd=ROOT, env={**os.environ, "PYTHONPATH": str(ROOT)}, check=True)
    made = page.read_text(encoding="utf-8")
    assert f"{card['pairs']['train']} pairs to train" in made
    assert f"| throwing | pass1-0.evaluation | {LABEL}" in made
    assert (page.parent / "pictures" / "learning" / "valid.svg").exists()
