"""The whole path of `scripts/learn` with a tiny model: data, training, evaluation, a design."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from agentflow.cli import main
from benchmarks.learning import chart

ROOT = Path(__file__).parents[2]
USED = ("agentflow", "benchmarks", "configs", "runs", "scripts")
LABEL = "tiny model from scratch, procedural data"
KINDS = ("pass1",)


def read_json(path: Path) -> Any:
    return json.loads(path.read_text(encoding="utf-8"))


def test_curves_have_round_numbers_on_their_axes() -> None:
    picture = chart("valid", {"pass1": [(0, 0.1), (45, 0.789)]})
    told = re.findall(r">([^<>]+)</text>", picture)
    steps = ["0", "10", "20", "30", "40"]
    assert told == ["valid", "0", "0.2", "0.4", "0.6", "0.8", *steps, "pass1"]


@pytest.mark.training
@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_a_tiny_model_learns_from_scratch_and_designs(tmp_path: Path) -> None:
    copy = tmp_path / "copy"
    for name in USED:
        shutil.copytree(ROOT / name, copy / name, ignore=shutil.ignore_patterns("__pycache__"))
    (copy / ".venv-training").symlink_to(sys.prefix)
    environment = {**os.environ, "PYTHONPATH": str(copy)}
    subprocess.run(["scripts/learn", "--quick"], cwd=copy, env=environment, check=True)

    made = copy / "learning-quick"
    card = read_json(made / "set" / "card.json")
    assert card["answers"] > 100
    assert 20 < sum(card["pairs"].values()) < card["answers"] + card["variants"]
    lines = (made / "sft-0" / "curves.jsonl").read_text().splitlines()
    losses = [row["loss"] for row in map(json.loads, lines) if "loss" in row]
    assert losses[-1] < losses[0]
    assert read_json(made / "sft-0" / "result.json")["label"] == LABEL
    for kind in KINDS:
        assert read_json(made / f"{kind}-0" / "result.json")["steps"] == 2
        measured = read_json(made / f"{kind}-0.evaluation" / "evaluation.json")
        assert measured["label"] == f"{LABEL}, GRPO ({kind})"
        assert measured["results"]["throwing"]["replies"] == 8

    page = (made / "learning.md").read_text(encoding="utf-8")
    assert f"{card['pairs']['train']} pairs to train" in page
    assert f"| throwing | pass1 | {LABEL}, GRPO (pass1) |" in page
    stages = {path.stem for path in made.glob("*.seconds")}
    assert {f"| {stage} |" in page for stage in stages} == {True}
    assert len(stages) == 2 + 2 * (1 + len(KINDS))
    pictures = re.findall(r"!\[[^]]+\]\(([^)]+)\)", page)
    assert "pictures/valid.svg" in pictures
    assert {(made / picture).is_file() for picture in pictures} == {True}

    runs = tmp_path / "runs"
    given = ["--workflow", "single", "--set", "trajectories=1", "--quiet", "--out", str(runs)]
    assert main(["design", "--task", "throwing", *given, "--model", str(made / "pass1-0")]) == 0
    [run] = runs.iterdir()
    assert read_json(run / "result.json")["model"].startswith(LABEL)
