"""The physics engine in runs, tables and pages, as a user sees it with two engines."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
import yaml

import agentflow
from agentflow.app.subjects.verify import rescore
from agentflow.cli import main
from agentflow.env.physics.engines import choose_engine
from agentflow.runs import read_document, read_result
from agentflow.runs.reading import document_text
from tests.app.pages.test_runs import RECORDED

pytestmark = [pytest.mark.pybullet, pytest.mark.mujoco]
CAR = str(Path(__file__).parents[2] / "examples" / "car.json")
SMALL = {"trajectories": 1, "max_simulations": 1, "verify": False}
Captured = pytest.CaptureFixture[str]
BULLET, MUJOCO = "pybullet", "mujoco"


def identity(name: str) -> str:
    return str(choose_engine(name).identity)


def shown(capsys: Captured, *words: str, status: int = 0) -> str:
    assert main(list(words)) == status
    return capsys.readouterr().out


HEAVY = {"cargo.mass": 10, "blocks.max": 22}
"""Knobs of a record that PyBullet alone has."""


def design(
    out: Path, task: str = "movement", knobs: dict[str, object] | None = None, **options: Any
) -> agentflow.Design:
    settings = {**SMALL, **(knobs or {})}
    return agentflow.design(task, workflow="random-dsl", settings=settings, out=out, **options)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of one random machine with MuJoCo."""
    return design(tmp_path_factory.mktemp("engines"), engine=MUJOCO).run


@pytest.mark.slow
def test_a_run_records_its_engine_and_keeps_it(run: Path, capsys: Captured) -> None:
    document = read_document(run)
    assert (document["engine"], document["config"]["engine"]) == (identity(MUJOCO), MUJOCO)
    assert read_result(run).engine == identity(MUJOCO)
    assert shown(capsys, "replay", str(run)) == "identical\n"
    facts = shown(capsys, "show", str(run)).splitlines()[1]
    assert facts == f"movement, random-dsl, {read_result(run).model}, seed 0, {identity(MUJOCO)}"


@pytest.mark.slow
def test_a_run_of_an_engine_that_is_not_there_says_so(
    run: Path, tmp_path: Path, capsys: Captured
) -> None:
    copy = shutil.copytree(run, tmp_path / "run")
    document = read_document(copy)
    config = {**document["config"], "engine": "fast"}
    other = {**document, "engine": "fast 1", "config": config}
    (copy / "run.yaml").write_text(document_text(other))
    assert main(["replay", str(copy)]) == 2
    assert capsys.readouterr().err == (
        f"agentflow: {copy} was made with fast 1, which is not installed; agentflow rescore "
        "simulates its machines with another engine\n"
    )
    assert "fast 1" in shown(capsys, "show", str(copy))
    found = rescore(copy)  # its purpose is to simulate with what is there
    assert found["engine"] == {"recorded": "fast 1", "now": identity("auto")}


@pytest.mark.slow
def test_a_run_from_before_engines_were_configured_keeps_its_recorded_engine(
    run: Path, tmp_path: Path
) -> None:
    copy = shutil.copytree(run, tmp_path / "run")
    document = read_document(copy)
    del document["config"]["engine"]
    (copy / "run.yaml").write_text(document_text(document))
    assert rescore(copy)["engine"] == {"recorded": identity(MUJOCO), "now": identity(MUJOCO)}


@pytest.mark.slow
def test_auto_is_recorded_as_what_it_stands_for(tmp_path: Path) -> None:
    made = design(tmp_path)
    assert made.data["engine"] == identity("auto")
    assert read_document(made.run)["config"]["engine"] == BULLET


@pytest.mark.slow
def test_rescoring_with_another_engine_names_both(run: Path, capsys: Captured) -> None:
    found = rescore(run, engine=BULLET)
    assert found["engine"] == {"recorded": identity(MUJOCO), "now": identity(BULLET)}
    assert found["identical"] == 0
    head, *_, engines, count = shown(capsys, "rescore", str(run), "--engine", BULLET).splitlines()
    assert f"recorded ({identity(MUJOCO)})  now ({identity(BULLET)})" in head
    assert engines == f"engine: recorded {identity(MUJOCO)}, now {identity(BULLET)}"
    assert count.startswith("0 of ")
    assert rescore(run)["identical"] == len(found["machines"])


@pytest.mark.slow
def test_lists_and_comparisons_tell_engines_apart(
    run: Path, tmp_path: Path, capsys: Captured
) -> None:
    shutil.copytree(RECORDED, tmp_path / "a")
    shutil.copytree(run, tmp_path / "b")
    head, first, second = shown(capsys, "runs", str(tmp_path)).splitlines()
    assert "engine" in head.split()
    assert identity(BULLET) in first
    assert identity(MUJOCO) in second
    told = shown(capsys, "compare", str(run), CAR, "--engine", BULLET).splitlines()
    assert told[0] == f"engine: {identity(BULLET)}"
    assert told[1] == (
        f"{run} was made with {identity(MUJOCO)}, but both are simulated with {identity(BULLET)} "
        "here"
    )


@pytest.mark.slow
def test_a_share_of_a_record_names_another_engine_of_the_record(
    run: Path, tmp_path: Path, capsys: Captured
) -> None:
    """Delivery of a heavy cargo has no record on MuJoCo; movement has one."""
    other = design(tmp_path, "delivery/5", knobs=HEAVY, engine=MUJOCO).run
    line = next(row for row in shown(capsys, "show", str(other)).splitlines() if "% of" in row)
    assert f"% of the record of {identity(BULLET)}, " in line
    assert f"(verified, {identity(BULLET)})" in line
    for own in (run, RECORDED):
        mine = next(row for row in shown(capsys, "show", str(own)).splitlines() if "% of" in row)
        assert "% of the record, " in mine


@pytest.mark.parametrize("name", [BULLET, MUJOCO])
def test_simulate_names_its_engine(name: str, capsys: Captured) -> None:
    words = (CAR, "--task", "movement", "--engine", name)
    assert shown(capsys, "simulate", *words).splitlines()[0].endswith(f", {identity(name)}")
    found = json.loads(shown(capsys, "simulate", *words, "--json"))
    assert (found["status"], found["engine"]) == ("ok", identity(name))


@pytest.mark.slow
def test_verification_shows_the_other_engine_outside_the_median(
    run: Path, tmp_path: Path, capsys: Captured
) -> None:
    copy = shutil.copytree(run, tmp_path / "run")
    found = json.loads(shown(capsys, "verify", str(copy), "--json"))
    assert found["engine"] == identity(MUJOCO)
    varied = [score["variation"] for score in found["verified"]["scores"]]
    assert varied[:2] == ["default", "4 x step rate"]
    (other,) = found["others"]
    assert (other["engine"], other["status"]) == (identity(BULLET), "ok")
    assert other["score"] == rescore(copy, engine=BULLET)["machines"][0]["now"]["score"]
    lines = shown(capsys, "verify", str(copy)).splitlines()
    assert lines[-1] == f"not part of the median: {other['score']:.2f} with {identity(BULLET)}"


@pytest.mark.slow
def test_a_sweep_with_both_engines_pools_nothing(tmp_path: Path, capsys: Captured) -> None:
    file = tmp_path / "both.yaml"
    base = {"task": "movement", "workflow": "random-dsl", "settings": {"max_simulations": 1}}
    table = {"metrics": ["mean", "share"]}
    axes = {"engine": [BULLET, MUJOCO]}
    file.write_text(yaml.safe_dump({"title": "Both", "base": base, "axes": axes, "table": table}))
    assert main(["sweep", str(file), "--out", str(tmp_path), "--quiet"]) == 0
    capsys.readouterr()
    text = shown(capsys, "table", str(tmp_path / "both"))
    both = f"{identity(BULLET)}, {identity(MUJOCO)}"
    assert f"Physics engine: {both}; no number is of more than one." in text
    assert f"Shares of records compare with machines that {identity(BULLET)} simulated." in text
    players = shown(capsys, "table", str(tmp_path / "both"), "--show", "human", "--format", "csv")
    assert [line.split(",")[3].strip(' "') for line in players.splitlines()[1:]] == [
        identity(BULLET),
        identity(MUJOCO),
    ]
    words = ["sweep", str(file), "--out", str(tmp_path / "x"), "--engine", MUJOCO, "--dry-run"]
    assert main(words) == 2
    assert "engine is varied by the sweep" in capsys.readouterr().err


@pytest.mark.slow
def test_pages_name_the_engine(run: Path, tmp_path: Path, capsys: Captured) -> None:
    report, gallery = tmp_path / "report.html", tmp_path / "gallery.html"
    shown(capsys, "report", str(run), "--out", str(report))
    assert f'["Physics engine","{identity(MUJOCO)}"]' in report.read_text()
    shown(capsys, "gallery", str(run), "--out", str(gallery))
    assert f'"title":"Machines \\u00b7 {identity(MUJOCO)}"' in gallery.read_text()
    shown(capsys, "gallery", str(run), str(RECORDED), "--out", str(gallery))
    for name in (BULLET, MUJOCO):
        assert f'seed 0, {identity(name)}"' in gallery.read_text()
