"""One part of each kind from outside the package, used as ours are.

tests/plugins holds a distribution as pip would leave it; it is on the path of the commands here.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from agentflow.app.design.replay import replay
from agentflow.errors import ConfigError
from agentflow.runs import read_document

ROOT = Path(__file__).parent.parent
PLUGINS = ROOT / "tests" / "plugins"
MAIN = "import sys; from agentflow.cli import main; sys.exit(main())"
SMALL = ("trajectories=2", "search.rounds=1", "search.width=1", "search.strategy=eager")
DESIGN = ("design", "--task", "rolling", "--workflow", "judged", "--set", "prompts=terse")
SWEEP = """
title: Seeds of a toy
about: Counts its own runs.
base: {task: rolling, workflow: random-dsl, settings: {trajectories: 1, max_simulations: 2}}
seeds: [0, 1]
axes: {condition: {plain: {}}}
table: {conditions: axes, stage: initial, metrics: [run_count, mean]}
"""


def python(code: str, *arguments: str, cwd: Path, plugins: Path = PLUGINS, status: int = 0) -> str:
    """Output of a Python process that finds the plugins; what it complains about if it fails."""
    environ = {name: os.environ[name] for name in ("PATH", "HOME") if name in os.environ}
    environ["PYTHONPATH"] = os.pathsep.join(map(str, (ROOT, plugins)))
    command = [sys.executable, "-W", "error", "-c", code, *arguments]
    done = subprocess.run(
        command, cwd=cwd, env=environ, capture_output=True, text=True, check=False
    )
    assert done.returncode == status, done.stdout + done.stderr
    return done.stderr if status else done.stdout


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of the toy workflow at the toy task, with the toy prompts and the toy strategy."""
    folder = tmp_path_factory.mktemp("toys")
    settings = [word for item in SMALL for word in ("--set", item)]
    result = json.loads(python(MAIN, *DESIGN, *settings, "--quiet", "--json", cwd=folder))
    assert (result["task"], result["workflow"], result["valid"]) == ("rolling", "judged", True)
    return folder / result["run"]


@pytest.mark.slow
def test_every_registry_lists_what_was_added(tmp_path: Path) -> None:
    code = """
from agentflow.agents.registry import ROLES, model_roles, stage_of
from agentflow.app.pages.registry import PAGES
from agentflow.env.physics.registry import ENGINES
from agentflow.env.tasks.registry import FAMILIES
from agentflow.llm.procedural.mechanisms import MECHANISMS
from agentflow.metrics.cells import METRICS
from agentflow.prompts.registry import PROMPT_SETS
from agentflow.search.registry import STRATEGIES
from agentflow.workflows.registry import WORKFLOWS
every = (ROLES, PAGES, ENGINES, FAMILIES, METRICS, PROMPT_SETS, STRATEGIES, WORKFLOWS, MECHANISMS)
for registry in every:
    print(*(name for name in registry if name not in registry.ours and registry[name]))
print("judge" in model_roles(), stage_of("judge"))
"""
    assert python(code, cwd=tmp_path).split() == [
        *("judge", "plain", "absent", "toy", "rolling"),
        *("run_count", "terse", "dealer", "eager", "judged", "rolling"),
        *("True", "env_feedback"),
    ]


def test_contributing_names_every_group_and_files_that_exist() -> None:
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    section = text.split("## To add something\n", 1)[1].partition("\n## ")[0]
    info = PLUGINS / "toybox-1.0.dist-info" / "entry_points.txt"
    groups = re.findall(r"^\[(.*)\]$", info.read_text(), re.MULTILINE)
    assert set(re.findall(r"group `([\w.]+)`", section)) == set(groups)
    paths = re.findall(r"`((?:agentflow|tests|docs|examples)/[^`]+)`", section)
    assert len(paths) > 20
    assert [path for path in paths if not (ROOT / path).exists()] == []


@pytest.mark.slow
def test_the_lists_of_commands_name_what_was_added(tmp_path: Path) -> None:
    assert "rolling " in python(MAIN, "tasks", cwd=tmp_path)
    assert "terse " in python(MAIN, "prompts", "list", cwd=tmp_path)
    shown = python(MAIN, "prompts", "show", "--role", "judge", "--set", "terse", cwd=tmp_path)
    assert shown.startswith("--- system\nYou judge machines in one sentence.\n")


@pytest.mark.slow
def test_a_run_made_of_toys(run: Path) -> None:
    calls = [json.loads(line) for line in (run / "calls.jsonl").read_text().splitlines()]
    roles = {call["request"]["role"] for call in calls}
    assert roles == {"designer", "querier", "refiner", "judge"}
    prompts = {call["request"]["messages"][0]["text"] for call in calls}
    assert "You judge machines in one sentence.\n" in prompts
    judged = [call["reply"]["text"] for call in calls if call["request"]["role"] == "judge"]
    assert len(judged) == 2
    assert all(re.fullmatch(r"A (good|fine) machine of \d+ blocks\.", text) for text in judged)
    designs = [call for call in calls if call["request"]["role"] == "designer"]
    assert all("Roller: length " in call["reply"]["text"] for call in designs)
    events = [json.loads(line) for line in (run / "events.jsonl").read_text().splitlines()]
    assert sum(event["kind"] == "judgement" for event in events) == 2
    assert python(MAIN, "replay", str(run), cwd=run.parent) == "identical\n"
    plugins = read_document(run)["plugins"]
    assert list(plugins) == [
        *("task family rolling", "mechanisms of the task family rolling", "workflow judged"),
        *("search strategy eager", "prompt set terse", "role judge"),
    ]
    assert all(re.fullmatch(r"toybox 1\.0 source [0-9a-f]{16}", one) for one in plugins.values())
    with pytest.raises(ConfigError, match=r"needs the task family 'rolling' of toybox 1\.0 "):
        replay(run, pytest.fail)  # this process lacks it


@pytest.mark.slow
def test_a_strategy_that_deals_the_whole_budget_gets_its_options(tmp_path: Path) -> None:
    code = """
from agentflow.search.settings import SearchSettings
from agentflow.search.strategies import pooled
print([pooled(SearchSettings(strategy="dealer", options=o)).most for o in ({}, {"most": 3})])
"""
    assert python(code, cwd=tmp_path) == "[1, 3]\n"


@pytest.mark.slow
def test_a_role_without_templates_costs_no_call(tmp_path: Path) -> None:
    design = ("design", "--task", "rolling", "--workflow", "judged", "--quiet")
    assert python(MAIN, *design, cwd=tmp_path, status=2).startswith(
        "agentflow: the prompt set 'default' has no templates for the role 'judge': add judge/"
    )
    assert not (tmp_path / "runs").exists()


@pytest.mark.slow
def test_options_of_a_strategy_and_what_it_raises(tmp_path: Path) -> None:
    def design(*settings: str) -> str:
        words = [word for item in (*SMALL, *settings) for word in ("--set", item)]
        return python(MAIN, *DESIGN, *words, "--quiet", "--name", "toy", cwd=tmp_path, status=2)

    told = design("search.options.flor=1")
    assert told.startswith(
        "agentflow: settings.search.options of eager: unknown option 'flor'; known: floor, rates\n"
    )
    assert not (tmp_path / "runs").exists()
    told = design("search.strategy=dealer", "search.options.most=x")
    assert told == (
        "agentflow: settings.search.options of dealer: most: expected a whole number, not 'x'\n"
    )
    told = design("search.options.rates=[]")
    assert re.match(
        r"agentflow: the search strategy 'eager' \(toybox.parts:eager\) of the distribution "
        r"'toybox' failed: \S+parts.py, line \d+ raised IndexError: ",
        told,
    )


@pytest.mark.slow
def test_runs_of_an_edited_plug_in_are_not_mixed(tmp_path: Path) -> None:
    shutil.copytree(PLUGINS, tmp_path, dirs_exist_ok=True)
    path = tmp_path / "toys.yaml"
    search = "strategy: eager, rounds: 1, width: 1"
    path.write_text(
        SWEEP.replace("max_simulations: 2", f"search: {{{search}}}").replace(
            "random-dsl", "judged, prompts: terse"
        )
    )
    python(MAIN, "sweep", str(path), "--quiet", cwd=tmp_path, plugins=tmp_path)
    shutil.rmtree(tmp_path / "sweeps/toys/runs/plain.seed-1")
    parts = tmp_path / "toybox" / "parts.py"
    parts.write_text(parts.read_text() + "\n# edited\n")
    sweep = ("sweep", "sweeps/toys", "--resume", "--quiet")
    told = python(MAIN, *sweep, cwd=tmp_path, plugins=tmp_path, status=2)
    assert "plain.seed-0 was made with different task family rolling (toybox 1.0 source " in told
    assert "and search strategy eager (toybox 1.0 source " in told
    (tmp_path / "sweeps/toys/runs/plain.seed-0/result.json").unlink()
    resume = ("design", "--resume", "sweeps/toys/runs/plain.seed-0")
    told = python(MAIN, *resume, cwd=tmp_path, plugins=tmp_path, status=2)
    assert "was started with different task family rolling (toybox 1.0 source " in told


@pytest.mark.slow
def test_its_page(run: Path, tmp_path: Path) -> None:
    out = tmp_path / "page.html"
    python(MAIN, "report", str(run), "--page", "plain", "--out", str(out), cwd=tmp_path)
    assert out.read_text() == f"<p>{json.loads((run / 'result.json').read_text())['score']}</p>"


@pytest.mark.slow
def test_a_metric_in_a_table(tmp_path: Path) -> None:
    path = tmp_path / "toys.yaml"
    path.write_text(SWEEP)
    python(MAIN, "sweep", str(path), "--quiet", cwd=tmp_path)
    table = python(MAIN, "table", "sweeps/toys", "--format", "json", cwd=tmp_path)
    assert '"run_count"' in table
    text = python(MAIN, "table", "sweeps/toys", cwd=tmp_path)
    assert "run_count: number of runs" in text
    assert re.search(r"^run_count is computed by toybox 1\.0 source \w{16}\.$", text, re.MULTILINE)


@pytest.mark.slow
def test_an_engine_simulates(tmp_path: Path) -> None:
    code = """
from pathlib import Path
import sys
from agentflow.env.physics.engines import default_engine
from agentflow.env.physics.registry import ENGINES
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.registry import get_task
from agentflow.machine import library, read_machine
machine = read_machine(Path(sys.argv[1]).read_text(), library()).machine
toy, usual = (simulate(machine, get_task("rolling"), engine=spec.start())
              for spec in (ENGINES["toy"], default_engine()))
print(toy.status, toy.engine.partition(" ")[0], toy.score == usual.score, toy.score > 1)
"""
    car = ROOT / "examples" / "car.json"
    assert python(code, str(car), cwd=tmp_path) == "ok toy True True\n"
