"""Runs on a level whose machines bring control programs: search, record, replay, start, compare."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import agentflow
from agentflow.app.design.replay import replay
from agentflow.app.pages.compare import compare
from agentflow.machine import read_machine

LEVEL = "family: movement\ntitle: drive\ngood: 1\ncontrols: designed\nparameters: {window: 1}\n"


def ignore(*_: object) -> None:
    """Nobody reads what is said."""


@pytest.fixture
def level(tmp_path: Path) -> str:
    path = tmp_path / "designed.yaml"
    path.write_text(LEVEL, encoding="utf-8")
    return str(path)


@pytest.mark.slow
@pytest.mark.parametrize("workflow", ["single", "random-dsl", "explore"])
def test_runs_find_machines_with_programs_and_replay(
    level: str, tmp_path: Path, workflow: str
) -> None:
    settings = {"trajectories": 2, "max_simulations": 6, "search.rounds": 2}
    made = agentflow.design(
        level,
        workflow=workflow,
        settings={f"settings.{key}": value for key, value in settings.items()},
        out=tmp_path,
        workers=1,
        say=ignore,
    )
    files = list((made.run / "machines").glob("*.json"))
    machines = [read_machine(file.read_text(encoding="utf-8")).machine for file in files]
    assert any(machine is not None and machine.controls for machine in machines)
    assert [machine and machine.digest for machine in machines] == [file.stem for file in files]
    assert replay(made.run, ignore) is None


@pytest.mark.slow
def test_programs_are_revised_between_trials(level: str, tmp_path: Path) -> None:
    Path(level).write_text(f"{LEVEL}trials: 3\n", encoding="utf-8")
    settings = {"settings.trajectories": 2, "settings.search.rounds": 0}
    made = agentflow.design(
        level, workflow="single", settings=settings, out=tmp_path, workers=1, say=ignore
    )
    events = [json.loads(line) for line in (made.run / "events.jsonl").read_text().splitlines()]
    tried = [event["label"] for event in events if event["kind"] == "evaluation"]
    assert {"initial/traj-1", "initial/traj-1/try-1", "initial/traj-1/try-2"} <= {*tried}
    assert replay(made.run, ignore) is None


@pytest.mark.slow
def test_a_search_shows_all_trials_before_it(level: str, tmp_path: Path) -> None:
    Path(level).write_text(f"{LEVEL}trials: 3\n", encoding="utf-8")
    settings = {"trajectories": 1, "inspector": False, "querier": False}
    search = {"strategy": "mcts", "rounds": 1, "width": 1, "request_rounds": 1}
    made = agentflow.design(
        level,
        workflow="iterative",
        settings={"settings": settings | {"search": search}},
        out=tmp_path,
        workers=1,
        say=ignore,
    )
    calls = [json.loads(line) for line in (made.run / "calls.jsonl").read_text().splitlines()]
    asked = calls[-1]["request"]["messages"][-1]["text"]
    history = asked.partition("## Edit history")[2].partition("\n## ")[0]
    assert [line[2:4] for line in history.splitlines() if ", score " in line] == ["1.", "2.", "3."]
    assert history.count("Control ") >= 2  # the commands of the two later trials


@pytest.mark.slow
def test_a_run_starts_from_a_machine_with_a_program(level: str, tmp_path: Path) -> None:
    car = json.loads(Path("examples/car.json").read_text(encoding="utf-8"))
    controls = [{"group": "motors", "at": 0, "for": 1, "level": 0.5}]
    made = agentflow.design(
        level,
        workflow="random-dsl",
        settings={
            "settings.start": {"blocks": car, "controls": controls},
            "settings.max_simulations": 2,
        },
        out=tmp_path,
        workers=1,
        say=ignore,
    )
    assert made.valid


def test_a_comparison_names_the_controls_that_differ(tmp_path: Path) -> None:
    car = json.loads(Path("examples/car.json").read_text(encoding="utf-8"))
    entries = [{"group": "motors", "at": 0, "for": 1, "level": level} for level in (1, 0.5)]
    for name, controls in (("a", entries[:1]), ("b", entries)):
        data = {"blocks": car, "controls": controls}
        (tmp_path / f"{name}.json").write_text(json.dumps(data), encoding="utf-8")
    sources = str(tmp_path / "a.json"), str(tmp_path / "b.json")
    found = compare(sources, None, None, workers=1, say=ignore)
    assert found["controls"] == [[], ["Control motors at 0 for 1 level 0.5"]]
