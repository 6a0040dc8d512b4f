"""How the designers of recorded runs behave, and the command that shows it."""

from __future__ import annotations

import json
import shutil
import tarfile
from pathlib import Path

import pytest

from agentflow.app.design.config import load_config
from agentflow.app.design.run import RunOptions, design
from agentflow.app.inspect.behaviour import moving_types, observe
from agentflow.cli import main
from agentflow.errors import RunError
from agentflow.metrics.behaviour import agent_edits
from agentflow.runs.events import read_typed_events
from tests.machine.builders import build

Captured = pytest.CaptureFixture[str]

RUNS = Path(__file__).parents[3] / "runs"
MODEL, PROCEDURAL = RUNS / "language-model-throwing", RUNS / "recorded-throwing"


def shown(*arguments: object, capsys: Captured) -> str:
    assert main(["behaviour", *map(str, arguments)]) == 0
    return capsys.readouterr().out


def test_the_moving_blocks_are_the_mechanism() -> None:
    log, block, wheel, hinge, container, boulder = 63, 1, 2, 5, 30, 36
    assert moving_types(build((log, 0, 0), (block, 1, 0))) == frozenset()
    assert moving_types(build((wheel, 0, 2), (hinge, 0, 0))) == {wheel, hinge}
    assert moving_types(build((container, 0, 4), (boulder, 1, 0))) == frozenset()


def test_predictions_of_a_model_stand_beside_its_scores(capsys: Captured) -> None:
    (found,) = json.loads(shown(MODEL, "--json", capsys=capsys))["sources"]
    assert (found["runs"], found["edits"]) == (1, 5)
    assert (found["misprediction"]["count"], found["misprediction"]["of"]) == (0, 1)
    assert found["surface_level"]["value"] is None  # nothing failed
    assert found["prediction"] == pytest.approx({"count": 4, "error": 9.0, "bias": -0.8}, abs=0.05)
    assert sum(found["effort"]["shares"].values()) == pytest.approx(1.0)
    assert list(found["effort"]["shares"]) == ["designer", "inspector", "refiner", "querier"]


def test_the_procedural_model_always_predicts_a_higher_score(capsys: Captured) -> None:
    (found,) = json.loads(shown(PROCEDURAL, "--json", capsys=capsys))["sources"]
    assert found["misprediction"]["of"] == found["edits"] == 6
    assert found["effort"]["shares"] == {}
    row = next(line for line in shown(PROCEDURAL, capsys=capsys).splitlines()
               if line.startswith(str(PROCEDURAL)))  # fmt: skip
    wrong = found["misprediction"]["count"]
    assert 0 < wrong < 6
    assert f"{wrong}/6 ({wrong / 6:.0%})" in row


def test_a_folder_adds_up_its_runs(tmp_path: Path) -> None:
    for run in (MODEL, PROCEDURAL):
        shutil.copytree(run, tmp_path / run.name)
    both, one, other = observe([tmp_path, MODEL, PROCEDURAL])
    assert both.runs == 2
    assert both.found == other.found + one.found or both.found == one.found + other.found


@pytest.mark.slow
def test_a_run_of_an_older_version_is_read(tmp_path: Path) -> None:
    file = Path(__file__).parent / "recorded" / "throwing-iterative.tar.xz"
    with tarfile.open(file) as archive:
        archive.extractall(tmp_path, filter="data")
    (found,) = observe([tmp_path])
    assert len(found.found.sizes) == 15
    assert len(found.found.errors) >= 10
    assert found.found.bias is not None
    assert found.found.bias > 0  # it expects too much


@pytest.mark.slow
def test_the_edits_of_an_agent_lead_from_one_simulated_machine_to_the_next(tmp_path: Path) -> None:
    settings = ["task=movement", "workflow=tools", "max_simulations=6", "candidates_per_stage=2"]
    config = load_config(None, [*settings, "verify=false"], {})
    run = Path(design(config, tmp_path, RunOptions()).run)
    made = list(agent_edits(read_typed_events(run)))
    assert made
    assert [one.informed for one in made] == sorted(one.informed for one in made)  # blind first
    (found,) = observe([run])
    assert found.found.local.of == len(made)
    assert found.found.mispredicted.of == 0  # the procedural agent writes nothing


def test_a_folder_without_runs_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RunError, match="contains no run"):
        observe([tmp_path])
    with pytest.raises(RunError, match="no such directory"):
        observe([tmp_path / "missing"])
