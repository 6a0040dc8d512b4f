"""Runs of the workflow `explore` end to end: resumed, replayed, and without pyribs."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from agentflow.app.design.replay import replay
from agentflow.app.design.run import design, resume
from agentflow.cli import main
from agentflow.config.run import build_config
from agentflow.extras import install
from agentflow.metrics.niches import Elites
from agentflow.runs import read_events, read_result
from agentflow.runs.events import read_typed_events
from agentflow.search.settings import MAP_ELITES
from tests.processes import run_python

SETTINGS = {
    "trajectories": 2,
    "max_simulations": 24,
    "querier": False,
    "emitters": ["edit", "crossover", "refiner"],
}
CONFIG = {
    "task": "movement",
    "workflow": "explore",
    "knobs": {"window": 1},
    "verify": False,
    "settings": SETTINGS,
}


def ignore(_line: str) -> None:
    """Ignores remarks."""


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small run of all three emitters; the procedural model refines."""
    return Path(design(build_config(CONFIG), tmp_path_factory.mktemp("runs")).run)


def archive(path: Path) -> Elites:
    found = Elites.of(read_typed_events(path))
    assert found is not None
    return found


@pytest.mark.slow
def test_a_run_fills_an_archive_within_its_budget(run: Path) -> None:
    result, found = read_result(run), archive(run)
    assert result.rollouts == 24
    assert result.score == max(event.score or 0.0 for event in found.cells.values())
    assert len(found.cells) > 3
    notes = [
        item["note"]
        for event in read_events(run)
        if event.kind == "expand"
        for item in event.data["attempts"]
    ]
    assert {"random edit", "crossover"} < set(notes)


@pytest.mark.slow
def test_a_replay_builds_the_same_archive_without_the_model(run: Path) -> None:
    assert replay(run, ignore) is None


@pytest.mark.slow
def test_a_killed_run_resumes_to_the_same_archive(run: Path, tmp_path: Path) -> None:
    after = 40
    config = tmp_path / "config.yaml"
    config.write_text(json.dumps(CONFIG))
    out = tmp_path / "runs"
    start = [sys.executable, "-c", "from agentflow.cli import main; main()"]
    options = ["--config", str(config), "--out", str(out), "--quiet"]
    process = subprocess.Popen([*start, "design", *options], stdout=subprocess.DEVNULL)
    while sum(len(file.read_bytes().splitlines()) for file in out.glob("*/events.jsonl")) < after:
        assert process.poll() is None
        time.sleep(0.02)
    process.send_signal(signal.SIGKILL)
    process.wait()
    (killed,) = out.iterdir()
    resume(killed)
    assert archive(killed) == archive(run)
    assert replay(killed, ignore) is None


@pytest.mark.parametrize(
    "options",
    [
        ["--workflow", "explore"],
        ["--workflow", "hierarchical", "--set", f"search.strategy={MAP_ELITES}"],
    ],
)
def test_without_pyribs_no_run_begins(
    options: list[str],
    tmp_path: Path,
    without: Callable[[str], None],
    capsys: pytest.CaptureFixture[str],
) -> None:
    without("ribs")
    out = tmp_path / "runs"
    assert main(["design", "--task", "movement", *options, "--out", str(out)]) == 2
    told = f"agentflow: pyribs is not installed; install it with: {install('explore')}\n"
    assert capsys.readouterr() == ("", told)
    assert not out.exists()


@pytest.mark.slow
def test_pyribs_is_imported_only_by_an_archive() -> None:
    code = (
        "import sys\n"
        "from agentflow.app.design.run import design\n"
        "from agentflow.search.registry import STRATEGIES\n"
        "from agentflow.workflows.registry import WORKFLOWS\n"
        "[*STRATEGIES.values(), *WORKFLOWS.values()]\n"
        "assert 'agentflow.search.elites.archive' in sys.modules\n"
        "sys.exit('ribs' in sys.modules)"
    )
    run_python("-c", code)
