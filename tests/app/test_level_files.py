"""A run of a level file works from any folder, after the file was edited and after it is gone."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
import yaml

from agentflow.app.design.plan import RunPlan
from agentflow.app.subjects.verify import rescore
from agentflow.cli import main
from agentflow.config.run import build_config
from agentflow.errors import ConfigError

LEVEL = {"family": "movement", "title": "Short", "good": 9, "parameters": {"window": 2}}
SMALL = ["--workflow", "random-dsl", "--rollouts", "2", "--set", "trajectories=1", "--quiet"]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished run of a level file, and beside it an unfinished copy."""
    folder = tmp_path_factory.mktemp("levels")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        Path("own.yaml").write_text(yaml.safe_dump(LEVEL))
        assert main(["design", "--task", "own.yaml", *SMALL, "--out", "runs"]) == 0
    (found,) = (folder / "runs").iterdir()
    return found


def edit_file(run: Path) -> str:
    edited = {**LEVEL, "parameters": {"window": 1}}
    (run.parents[1] / "own.yaml").write_text(yaml.safe_dump(edited))
    return "has changed since"


def remove_file(run: Path) -> str:
    (run.parents[1] / "own.yaml").unlink()
    return "cannot be read here"


@pytest.mark.slow
def test_every_command_works_without_the_file_and_says_so(
    run: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(run.parents[1])
    for change in (edit_file, remove_file):
        note = f"{run}: the level own.yaml {change(run)}; its copy in the run is used"
        assert main(["replay", str(run)]) == 0
        assert capsys.readouterr() == ("identical\n", f"agentflow: {note}\n")
        again = rescore(run)
        assert again["note"] == note
        assert again["identical"] == len(again["machines"]) > 0
        assert main(["render", str(run), "--out", "best.png"]) == 0
        assert capsys.readouterr().err == f"agentflow: {note}\n"
        assert main(["report", str(run), "--out", "report.html"]) == 0
        assert note in _page_text(Path("report.html"))
        assert main(["gallery", str(run), "--out", "gallery.html"]) == 0
        result = (run / "result.json").read_text()
        (run / "result.json").unlink()
        capsys.readouterr()
        assert main(["design", "--resume", str(run)]) == 0
        assert f"agentflow: {note}\n" in capsys.readouterr().err
        assert json.loads(result)["score"] == json.loads((run / "result.json").read_text())["score"]


def _page_text(page: Path) -> str:
    found = re.search(r'<script id="data"[^>]*>(.*?)</script>', page.read_text(), re.DOTALL)
    return str(json.loads(found[1])["facts"]) if found else page.read_text()


def test_the_level_in_a_run_is_complete_and_checked(tmp_path: Path) -> None:
    plan = RunPlan.of(build_config({"task": "movement/3"}))
    assert RunPlan.of_run(tmp_path, plan.run_document).task == plan.task
    older = {key: value for key, value in plan.run_document.items() if key != "level"}
    assert RunPlan.of_run(tmp_path, older).task == plan.task
    for level, problem in (
        ({"name": 3}, "must have a name and a number"),
        ({**plan.level.record, "good": "x"}, "good: expected a number"),
        ({**plan.level.record, "family": "rolling"}, "the task family 'rolling' of toybox 1.0"),
    ):
        document = {
            **plan.run_document,
            "level": level,
            "plugins": {"task family rolling": "toybox 1.0"},
        }
        with pytest.raises(ConfigError, match=problem):
            RunPlan.of_run(tmp_path, document)
