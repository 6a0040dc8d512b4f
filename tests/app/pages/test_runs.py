"""Reports and galleries of runs on disk."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from agentflow.app.design.execution import best_machine
from agentflow.app.pages.films import Shapes, machine_data
from agentflow.app.pages.gallery import gallery
from agentflow.app.pages.runs import report
from agentflow.cli import main
from agentflow.env.physics.engines import default_engine
from agentflow.env.rollout import RolloutEvent
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.registry import get_task
from agentflow.errors import RunError, UsageError
from agentflow.holding import with_holding
from agentflow.runs import read_document, read_result
from agentflow.runs.reading import document_text
from tests.app.sweeps.test_tables import sweep, verification
from tests.metrics.events import candidate
from tests.report.hostile import BREAKS, HOLDS, hostile_run, machine

RECORDED = Path(__file__).parents[3] / "runs" / "recorded-throwing"


VERIFIED = {
    "score": 11.0,
    "low": 9.5,
    "high": 12.0,
    "scores": [
        {"variation": "default", "status": "ok", "score": 12.0},
        {"variation": "4 x step rate", "status": "ok", "score": 11.0},
        {"variation": "masses +2 %", "status": "ok", "score": 9.5},
    ],
}
"""A verification, shortened."""


def quiet(_done: int, _of: int) -> None:
    """Ignores progress."""


def data_of(page: Path) -> dict[str, Any]:
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', page.read_text())
    assert found is not None
    data: dict[str, Any] = json.loads(found.group(1))
    return data


def test_machines_without_a_film_are_shown_as_built(tmp_path: Path) -> None:
    run = shutil.copytree(RECORDED, tmp_path / "run")
    shutil.rmtree(run / "rollouts")
    out = report(run, tmp_path / "r.html", films=0, workers=1, say=quiet)
    data = data_of(out)
    assert {m["film"]["samples"] for m in data["machines"].values()} == {1}
    assert {m["remark"] for m in data["machines"].values()} == {
        "Shown as built: this page only has films of better machines."
    }
    assert len(data["machines"]) == 8
    assert len(data["shapes"]) < 40
    assert {row["role"] for row in data["validity"]} == {
        "meta_designer",
        "designer",
        "inspector",
        "refiner",
        "querier",
    }


@pytest.mark.slow
def test_the_verified_score_is_shown_beside_the_score(tmp_path: Path) -> None:
    run = shutil.copytree(RECORDED, tmp_path / "run")
    result = read_result(run)
    (run / "result.json").write_text(json.dumps({**result.to_json(), "verified": VERIFIED}))
    data = data_of(report(run, tmp_path / "r.html", films=0, workers=1, say=quiet))
    assert (data["run"]["score"], data["run"]["verified"]) == (result.score, with_holding(VERIFIED))


@pytest.mark.slow
def test_a_run_in_progress_is_read_once(tmp_path: Path) -> None:
    """The run continues while films are made; all numbers are from before."""
    run = hostile_run(tmp_path)
    before = (run / "calls.jsonl").read_bytes()

    def goes_on(_done: int, _of: int) -> None:
        with (run / "calls.jsonl").open("wb") as file:
            file.write(before + before)

    usage = data_of(report(run, tmp_path / "r.html", films=1, workers=1, say=goes_on))["usage"]
    assert (run / "calls.jsonl").stat().st_size == 2 * len(before)
    assert usage[-1]["calls"] == 3


@pytest.mark.parametrize(
    ("name", "value", "change"),
    [
        ("constants", "older", "constants"),
        ("engine", "other 1", f"engine (other 1, now {default_engine().identity})"),
    ],
)
@pytest.mark.slow
def test_recorded_films_are_shown_if_physics_has_changed(
    tmp_path: Path, name: str, value: str, change: str
) -> None:
    run = shutil.copytree(RECORDED, tmp_path / "run")
    document = {**read_document(run), name: value}
    (run / "run.yaml").write_text(document_text(document))
    told: list[tuple[int, int]] = []
    out = report(run, tmp_path / "r.html", films=1, workers=1, say=lambda *done: told.append(done))
    kept = [file.stem for file in (run / "rollouts").glob("*.npz")]
    machines = data_of(out)["machines"]
    assert kept
    for digest in kept:
        times = [round(time, 3) for time in machines[digest]["film"]["times"]]
        assert {0.0, 0.2, 0.4} <= set(times)
        assert len(times) <= 2 * 26  # every 0.2 s, and around events
        assert machines[digest]["remark"] == f"As recorded, with different {change}."
    winner = best_machine(read_result(run))
    assert winner is not None
    best = machines[winner.digest]
    assert best["traces"] == [
        {"body": 0, "name": "Starting Block"},
        {"body": best["hero"], "name": "boulder"},
    ]
    assert len(best["solids"]) == len(read_result(run).machine)
    assert told == []  # nothing is simulated
    (run / "rollouts" / f"{kept[0]}.npz").write_bytes(b"damaged")
    damaged = data_of(report(run, out, films=0, workers=1, say=quiet))["machines"][kept[0]]
    assert damaged["remark"] == "Shown as built: its recorded rollout cannot be read."


@pytest.mark.slow
def test_a_different_score_today_is_mentioned(tmp_path: Path) -> None:
    run, told = hostile_run(tmp_path), []
    say = lambda *done: told.append(done)  # noqa: E731
    out = report(run, tmp_path / "r.html", films=9, workers=1, say=say)
    assert told == [(1, 2), (2, 2)]
    shown = data_of(out)["machines"][machine(HOLDS).digest]
    assert re.fullmatch(
        r"Simulated again with different constants: [0-9.]+; the recorded score is 12\.50\.",
        shown["remark"],
    )


def test_breakages_are_listed_with_time_and_place() -> None:
    task, broken = get_task("throwing"), machine(BREAKS)
    rollout = simulate(broken, task, seed=0)
    shown = machine_data(broken, rollout, Shapes(), "remark")
    first = rollout.broken[0]
    assert shown["breaks"][first.block] == first.time
    event = next(item for item in shown["events"] if item["kind"] == "broke")
    assert re.fullmatch(
        r"block \d+ \([A-Z][A-Za-z ]+\) broke off block \d+ \([A-Z][A-Za-z ]+\) at load [\d.]+",
        event["text"],
    )
    assert shown["remark"] == "remark"
    assert shown["feedback"] == rollout.feedback.text


def test_every_trial_but_the_one_shown_has_a_film() -> None:
    item, task = machine(HOLDS), get_task("throwing")
    rollout = simulate(item, task, seed=0)
    stalled = RolloutEvent(1.0, "motor_stalled", (3,), "block 3 (Powered Wheel) from 1.0 to 2.0 s")
    told: dict[str, float | bool | str | None] = {
        "trial_1": True,
        "outcome_1": "success",
        "trial_2": False,
        "outcome_2": "failed",
        "shown_trial": 2.0,
    }
    whole = replace(rollout, terms=told, events=(stalled,))
    shown = machine_data(item, whole, Shapes(), played=(rollout, rollout))
    (first, second) = shown["trials"]
    assert (first["number"], first["outcome"], first["shown"]) == (1, "success", False)
    assert second == {"number": 2, "success": False, "outcome": "failed", "shown": True}
    assert rollout.trace is not None
    assert first["film"]["times"] == pytest.approx(rollout.trace.even.times[::3], abs=1e-4)
    assert shown["film"]["times"] == pytest.approx(rollout.trace.times, abs=1e-4)
    assert [event["text"] for event in shown["events"]] == [
        "motor stalled: block 3 (Powered Wheel) from 1.0 to 2.0 s"
    ]
    assert machine_data(item, rollout, Shapes(), played=(rollout, rollout))["trials"] == []


@pytest.mark.slow
def test_given_cogs_and_wind_are_named() -> None:
    given = get_task("gearing").brief.given
    shapes = Shapes()
    shown = machine_data(given, None, shapes, given=given)
    assert [name for name, _ in shown["given"]] == ["source", "target"]
    colors = [shapes.rows[shown["solids"][block][0]][-3:] for block in (1, 2)]
    assert colors == [color for _, color in shown["given"]]
    windy = get_task("throwing", {"wind": {"speed": -8, "cross": 2.5}})
    rollout = replace(simulate(machine(HOLDS), windy, seed=0), scene=windy.scene())
    filmed = machine_data(machine(HOLDS), rollout, Shapes())
    assert filmed["wind"] == "2.5 m/s towards x+ and 8 m/s towards z+"
    assert shown["wind"] == ""


def test_block_types_share_their_solids() -> None:
    shapes = Shapes()
    shown = [machine_data(machine(name), None, shapes) for name in (BREAKS, BREAKS, HOLDS)]
    assert shown[0]["solids"] == shown[1]["solids"]
    used = {number for item in shown for numbers in item["solids"] for number in numbers}
    assert used == set(range(len(shapes.rows)))


@pytest.mark.slow
def test_a_sweep_is_reported_with_its_tables(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    axes = {"condition": {"chain": {"search.strategy": "random"}, "mcts": {}}}
    runs = {
        "chain.seed-0": [candidate("env_feedback", 1, 2.0), verification(2.0, 1.0, 1.5)],
        "mcts.seed-0": [candidate("env_feedback", 1, 4.0)],
    }
    path = sweep(tmp_path, runs, seeds=[0], axes=axes, base={"task": "throwing"})
    assert main(["report", str(path)]) == 0
    assert capsys.readouterr() == (f"{path / 'report.html'}\n", "")
    data = data_of(path / "report.html")
    assert (data["kind"], data["title"]) == ("sweep", "Hand")
    assert [(row["name"], row["values"], row["runs"]) for row in data["spreads"]] == [
        ("chain", [2.0], ["chain.seed-0"]),
        ("mcts", [4.0], ["mcts.seed-0"]),
    ]
    assert [table["title"] for table in data["tables"]] == [
        *("Hand", "scores", "usage", "verified scores")
    ]
    # none against expansions, nothing was searched; none of players, none are published
    assert data["runs"] == [
        {"name": "chain.seed-0", "state": "done", "score": 2.0, "verified": 1.5, "fragile": False},
        {"name": "mcts.seed-0", "state": "done", "score": 4.0, "verified": None, "fragile": False},
    ]


@pytest.mark.slow
def test_a_gallery_of_folders_of_runs(tmp_path: Path) -> None:
    shutil.copytree(RECORDED, tmp_path / "runs" / "a")
    shutil.copytree(RECORDED, tmp_path / "runs" / "b")
    result = json.loads((RECORDED / "result.json").read_text()) | {"verified": VERIFIED}
    (tmp_path / "runs" / "b" / "result.json").write_text(json.dumps(result))
    shutil.copytree(RECORDED, tmp_path / "runs" / "c")
    fragile = {**result, "score": 99.0, "verified": {**VERIFIED, "score": 1.0}}
    (tmp_path / "runs" / "c" / "result.json").write_text(json.dumps(fragile))
    none = {**result, "valid": False, "machine": None, "score": None, "reason": "all overlapped"}
    none["verified"] = None
    (tmp_path / "runs" / "a" / "result.json").write_text(json.dumps(none))
    hostile_run(tmp_path / "runs")  # unfinished: left out
    out = gallery([tmp_path / "runs"], tmp_path / "g.html", workers=1, say=quiet)
    data = data_of(out)
    score = read_result(RECORDED).score
    keys = ("run", "task", "score", "verified", "why")
    assert [tuple(card[key] for key in keys) for card in data["cards"]] == [
        ("b", "throwing", score, 11.0, ""),
        ("c", "throwing", 99.0, 1.0, ""),
        ("a", "throwing", None, None, "all overlapped"),
    ]
    records = [card["record"] for card in data["cards"]]
    assert [record["share"] and round(record["share"], 2) for record in records] == [
        0.05,
        0.0,
        None,
    ]
    assert {record["engine"].partition(" ")[0] for record in records} == {"pybullet"}
    assert data["cards"][0]["asked"]["good"] == 45
    assert data["cards"][0]["asked"]["title"] == "walled arena"
    assert data["cards"][0]["about"] == "hierarchical, procedural (no language model), seed 0"
    assert data["cards"][0]["picture"].startswith("data:image/png;base64,")


def test_a_gallery_needs_a_finished_run(tmp_path: Path) -> None:
    with pytest.raises(RunError) as caught:
        gallery([tmp_path], tmp_path / "g.html", workers=1, say=quiet)
    assert str(caught.value) == (
        f"{tmp_path} contains no finished run: expected a run directory or a folder with runs"
    )


def test_an_unwritable_file_is_refused_before_any_work(tmp_path: Path) -> None:
    for out, why in (
        (tmp_path / "none" / "r.html", f"no such directory: {tmp_path / 'none'}"),
        (tmp_path, "it is a directory"),
    ):
        with pytest.raises(UsageError) as caught:
            report(RECORDED, out, films=0, workers=1, say=quiet)
        assert str(caught.value) == f"cannot write {out}: {why}"


@pytest.mark.slow
def test_the_commands(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "r.html"
    assert main(["report", str(RECORDED), "--films", "0", "--out", str(out)]) == 0
    assert capsys.readouterr() == (f"{out}\n", "")
    assert main(["report", str(tmp_path)]) == 2
    assert capsys.readouterr().err == (
        f"agentflow: {tmp_path} is not a run directory: it has no readable run.yaml\n"
    )
    assert main(["report", "nowhere"]) == 2
    assert capsys.readouterr().err == (
        "agentflow: nowhere is not a run directory: it has no readable run.yaml\n"
    )
    assert main(["gallery", str(RECORDED), "--out", str(out)]) == 0
    assert capsys.readouterr() == (f"{out}\n", "")
