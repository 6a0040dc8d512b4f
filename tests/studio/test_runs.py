"""The API of runs: the list, a run that grows, designs that are started and stopped."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from datetime import datetime, timedelta, timezone
from pathlib import Path
from statistics import mean
from typing import Any

import httpx
import pytest
import yaml

from agentflow.app.design.config import load_config
from agentflow.app.design.plan import RunPlan
from agentflow.app.inspect.overview import run_details, run_list
from agentflow.app.pages.sweeps import sweep_page_data
from agentflow.cli import main
from agentflow.files.folders import lock_file
from agentflow.runs import RunDirectory, read_calls, read_events, state_of
from agentflow.runs.reading import document_text
from agentflow.studio.folder import RunFolder
from agentflow.studio.watching.listing import CORES, START_S, Listing, usual_seconds
from tests.app.sweeps.test_tables import sweep
from tests.metrics.events import candidate
from tests.studio.serving import Browser, studio

RECORDED = Path(__file__).parent.parent.parent / "runs" / "recorded-throwing"
PATIENCE = 120.0


@pytest.fixture
def runs(tmp_path: Path) -> Path:
    shutil.copytree(RECORDED, tmp_path / "runs" / "throwing")
    return tmp_path / "runs"


@pytest.fixture
def browser(runs: Path) -> Iterator[Browser]:
    with studio(runs) as served:
        yield served.enter()


def until(met: Any) -> None:
    deadline = time.monotonic() + PATIENCE
    while not met():
        assert time.monotonic() < deadline
        time.sleep(0.1)


def news(browser: Browser, **query: str) -> Iterator[dict[str, Any]]:
    """What a stream tells."""
    timeout = httpx.Timeout(PATIENCE)
    with browser.client.stream("GET", "/api/follow", params=query, timeout=timeout) as stream:
        for line in stream.iter_lines():
            if line.startswith("data: "):
                yield json.loads(line.removeprefix("data: "))


def test_the_list_is_that_of_the_command_line_and_a_curve(browser: Browser, runs: Path) -> None:
    [row] = browser.get("/api/runs")
    [known] = run_list(runs)
    assert (row["run"], row["sweep"]) == ("throwing", None)
    same = ("state", "task", "workflow", "model", "seed", "score", "calls", "problem")
    assert {key: row[key] for key in same} == {key: known[key] for key in same}
    assert row["seconds"] == max(event.at for event in read_events(runs / "throwing"))
    details = run_details(runs / "throwing")
    assert row["share"] == pytest.approx(details["record"]["share"])
    picture = browser.client.get(f"/api/picture?run=throwing&machine={row['machine']}")
    assert picture.headers["content-type"] == "image/png"
    scores = [score for _, score in row["curve"]]
    assert scores == sorted(set(scores))
    assert scores[-1] == pytest.approx(known["score"])


def test_rows_are_read_again_only_when_files_change(runs: Path) -> None:
    listing = Listing(RunFolder(runs))
    [before] = listing.rows()
    assert listing.rows()[0] is before
    (runs / "throwing" / "result.json").unlink()
    [after] = listing.rows()
    assert after is not before
    assert (before["state"], after["state"]) == ("done", "stopped")
    assert after["curve"] == before["curve"]


def test_a_look_that_has_no_time_tells_what_is_left_and_the_next_one_goes_on(runs: Path) -> None:
    for name in ("b", "c"):
        shutil.copytree(RECORDED, runs / name)
    os.utime(runs / "b", (2e9, 2e9))  # the newest comes first
    listing, found = Listing(RunFolder(runs)), []
    for _ in range(3):
        rows, left = listing.look(0)
        found.append(([row["run"] for row in rows], left))
    assert found[0] == (["b"], 2)
    assert [(len(names), left) for names, left in found] == [(1, 2), (2, 1), (3, 0)]
    assert sorted(row["run"] for row in listing.rows()) == ["b", "c", "throwing"]
    assert {row["unit"] for row in listing.rows()} == {"m"}


def test_runs_of_a_sweep_name_it(runs: Path) -> None:
    (runs / "study").mkdir()
    (runs / "study" / "sweep.yaml").touch()
    shutil.copytree(RECORDED, runs / "study" / "runs" / "a")
    rows = {row["run"]: row["sweep"] for row in Listing(RunFolder(runs)).rows()}
    assert rows == {"throwing": None, "study/runs/a": "study"}


def test_a_damaged_run_is_listed_with_its_problem(browser: Browser, runs: Path) -> None:
    (runs / "throwing" / "run.yaml").write_text("schema: 1\n")
    [row] = browser.get("/api/runs")
    assert row["state"] == "damaged"
    assert "edited" in row["problem"]


def test_a_run_began_when_it_says_so_not_when_its_files_were_copied(runs: Path) -> None:
    config = load_config(None, (), {"task": "movement"})
    document = {**RunPlan.of(config).run_document, "began": "2026-01-02T03:04:05+00:00"}
    RunDirectory.create(runs, "older", document).close()
    rows = {row["run"]: row["begun"] for row in Listing(RunFolder(runs)).rows()}
    assert rows["older"] == datetime(2026, 1, 2, 3, 4, 5, tzinfo=timezone.utc).timestamp()


def test_runs_of_different_tasks_are_not_compared(browser: Browser, runs: Path) -> None:
    config = load_config(None, (), {"task": "movement"})
    RunDirectory.create(runs, "driving", RunPlan.of(config).run_document).close()
    answer = browser.client.get("/api/pair?a=throwing&b=driving")
    assert "only runs of one task can be compared" in answer.text
    assert "--" not in answer.text


def test_closing_while_films_are_simulated_logs_nothing(
    runs: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with ThreadPoolExecutor() as threads, studio(runs) as served:
        browser = served.enter()
        [row] = browser.get("/api/runs")
        nodes = browser.get("/api/run", run=row["run"])["nodes"]
        for machine in {node["machine"] for node in nodes} - {None}:
            query = {"run": row["run"], "machine": machine}
            threads.submit(browser.client.get, "/api/machine", params=query)
        time.sleep(0.5)  # fewer than all of them are simulated by then
    assert [record.getMessage() for record in caplog.records] == []


def test_scorecards_and_sweeps_have_their_pages(
    browser: Browser, runs: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def models() -> list[int]:
        return [len(board["cards"]) for board in browser.get("/api/leaderboards")]

    assert models() == [3, 2, 1]  # those that the repository ships
    with monkeypatch.context() as patch:  # which are not drawn again
        patch.delattr("agentflow.studio.watching.routes.leaderboard_data")
        assert models() == [3, 2, 1]
    (runs / "bench").mkdir()
    shutil.copy(RECORDED.parents[1] / "docs/cards/procedural.json", runs / "bench/card.json")
    assert models() == [2, 3, 1]  # a copy is no model more, and its board is the first
    monkeypatch.setattr("agentflow.studio.folder.SHIPPED", runs / "none")  # without the repository
    assert models() == [1]
    (runs / "bench" / "card.json").unlink()
    assert models() == []
    for name in ("throwing", "..", "bench"):
        assert browser.client.get(f"/api/sweep?sweep={name}").status_code == 400


def test_the_time_of_a_design_is_judged_by_the_last_ones_here(runs: Path) -> None:
    document = yaml.safe_load((runs / "throwing" / "run.yaml").read_text())
    del document["seal"]
    document["began"] = datetime.now(timezone.utc).isoformat()
    (runs / "throwing" / "run.yaml").write_text(document_text(document))
    listing = Listing(RunFolder(runs))
    [row] = listing.rows()
    usual = usual_seconds(RunPlan.of_run(runs / "throwing", document))
    assert listing.pace("throwing/3") == listing.pace("movement") == row["seconds"] / usual


def test_of_several_designs_the_middle_of_the_last_three_sets_the_pace(runs: Path) -> None:
    document = yaml.safe_load((runs / "throwing" / "run.yaml").read_text())
    del document["seal"]
    events = (runs / "throwing" / "events.jsonl").read_text().splitlines()
    now, ends = datetime.now(timezone.utc), (90.0, 20.0, 50.0, 10.0)  # s; the first is the oldest
    for number, end in enumerate(ends):
        path = shutil.copytree(runs / "throwing", runs / f"run-{number}")
        document["began"] = (now - timedelta(hours=len(ends) - number)).isoformat()
        (path / "run.yaml").write_text(document_text(document))
        late = json.dumps({**json.loads(events[-1]), "at": end})
        (path / "events.jsonl").write_text("\n".join([*events[:-1], late, ""]))
    shutil.rmtree(runs / "throwing")
    listing = Listing(RunFolder(runs))
    listing.rows()
    usual = usual_seconds(RunPlan.of_run(runs / "run-0", document))
    assert listing.pace("throwing") == pytest.approx(20.0 / usual)


def test_without_designs_the_pace_is_that_of_a_busy_computer(
    runs: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    listing = Listing(RunFolder(runs / "none"))
    for load, pace in ((0.0, 1.0), (1.5 * CORES, 2.5)):
        monkeypatch.setattr(os, "getloadavg", lambda load=load: (load, 0.0, 0.0))
        assert listing.pace("throwing") == pace
    idle = usual_seconds(RunPlan.of(load_config(None, (), {"task": "throwing"})))
    assert idle == pytest.approx(START_S + 42.4 / min(2, CORES))


def test_a_call_of_a_model_takes_and_costs_what_it_did_in_its_last_run(tmp_path: Path) -> None:
    path = shutil.copytree(RECORDED.parent / "language-model-throwing", tmp_path / "one")
    document = yaml.safe_load((path / "run.yaml").read_text())
    del document["seal"]
    calls = list(read_calls(path))
    model, times = calls[0]["model"], [call["reply"]["latency_s"] for call in calls]
    listing = Listing(RunFolder(tmp_path))
    listing.rows()
    seconds = pytest.approx(mean(times))
    assert listing.call_costs(model) == {"call_seconds": seconds, "call_money": None}
    assert listing.call_costs("other") == {"call_seconds": None, "call_money": None}
    document["config"]["model"]["prices"] = {model: {"input": 0.0, "output": 1e6}}
    (path / "run.yaml").write_text(document_text(document))
    spent = mean(call["reply"]["usage"]["completion"] for call in calls)
    found = {"call_seconds": seconds, "call_money": pytest.approx(spent)}
    assert listing.call_costs(model) == found


def test_a_page_of_a_sweep_is_made_again_only_when_a_run_begins_or_ends(tmp_path: Path) -> None:
    path = sweep(tmp_path, {"seed-0": [candidate("initial", 1, 2.0)]}, seeds=[0, 1])
    listing = Listing(RunFolder(tmp_path))
    listing.rows()
    before = listing.sweep(path)
    assert listing.sweep(path) is before
    assert before == sweep_page_data(path)
    assert [run["state"] for run in before["runs"]] == ["done", "not started"]
    (path / "runs" / "seed-1").mkdir()
    shutil.copy(path / "runs" / "seed-0" / "run.yaml", path / "runs" / "seed-1")
    with (path / "runs" / "seed-1" / "run.yaml").open("rb") as file:
        lock_file(file.fileno())
        assert [run["state"] for run in listing.sweep(path)["runs"]] == ["done", "running"]
    assert [run["state"] for run in listing.sweep(path)["runs"]] == ["done", "stopped"]
    shutil.rmtree(path / "runs" / "seed-1")
    shutil.copytree(path / "runs" / "seed-0", path / "runs" / "seed-1")
    after = listing.sweep(path)
    assert [run["state"] for run in after["runs"]] == ["done", "done"]
    assert after == sweep_page_data(path)


def test_an_empty_folder_has_no_runs(tmp_path: Path) -> None:
    with studio(tmp_path / "none") as served:
        assert served.enter().get("/api/runs") == []


def test_a_run_has_the_data_of_its_report(browser: Browser) -> None:
    data = browser.get("/api/run", run="throwing")
    assert (data["kind"], data["run"]["task"]) == ("run", "throwing")
    assert data["nodes"]
    assert "machines" not in data
    workflows = browser.get("/api/start")["workflows"]["throwing"]
    assert next(iter(workflows)) == "hierarchical"
    assert workflows["explore"].startswith("One first machine per trajectory, then a search")


@pytest.mark.slow
def test_a_stream_follows_the_events_as_they_are_written(browser: Browser, runs: Path) -> None:
    run = runs / "throwing"
    result, events = run / "result.json", run / "events.jsonl"
    lines = events.read_bytes().splitlines(keepends=True)
    finished = result.read_bytes()
    result.unlink()
    half = len(lines) // 2
    events.write_bytes(b"".join(lines[:half]) + lines[half][:20])  # half a line is no event
    stream = news(browser, run="throwing")
    first = next(stream)
    assert first["state"] == "stopped"
    with events.open("ab") as file:
        file.write(lines[half][20:] + b"".join(lines[half + 1 :]))
    second = next(stream)
    result.write_bytes(finished)
    rest = [second, *stream]
    assert rest[-1]["state"] == "done"
    points = [point for item in (first, *rest) for point in item["points"]]
    whole = browser.get("/api/run", run="throwing")["progress"]
    assert [point["score"] for point in points] == [point["score"] for point in whole]
    assert rest[-1]["best"] == max(point["score"] for point in points)


def test_a_stream_of_a_damaged_run_says_so_and_ends(browser: Browser, runs: Path) -> None:
    (runs / "throwing" / "events.jsonl").write_text("{}\n")
    [told] = news(browser, run="throwing")
    assert "damaged" in told["problem"]


@pytest.mark.slow
def test_a_stream_of_the_list_tells_what_comes_and_goes(browser: Browser, runs: Path) -> None:
    stream = news(browser)
    assert [row["run"] for row in next(stream)["rows"]] == ["throwing"]
    shutil.copytree(runs / "throwing", runs / "second")
    told = next(stream)
    while not told["rows"]:
        told = next(stream)
    assert told["rows"][-1]["run"] == "second"
    shutil.rmtree(runs / "throwing")
    until(lambda: "throwing" in next(stream)["gone"])


@pytest.mark.slow
def test_a_machine_comes_with_its_film(browser: Browser) -> None:
    data = browser.get("/api/run", run="throwing")
    best = next(node for node in data["nodes"] if node["best"])
    found = browser.get("/api/machine", run="throwing", machine=best["machine"])
    assert found["machine"]["film"]["samples"] > 10
    assert len(found["machine"]["solids"]) == len(
        json.loads((RECORDED / "machines" / f"{best['machine']}.json").read_text())
    )


@pytest.mark.slow
def test_two_runs_are_compared_with_both_films(browser: Browser, runs: Path) -> None:
    shutil.copytree(runs / "throwing", runs / "again")
    data = browser.get("/api/pair", a="throwing", b="again")
    assert [machine["source"] for machine in data["machines"]] == ["throwing", "again"]
    assert data["only"] == [[], []]
    assert all(film["film"]["samples"] > 10 for film in data["films"])


def row_of(browser: Browser, name: str) -> dict[str, Any]:
    return next(row for row in browser.get("/api/runs") if row["run"] == name)


FORM = {"task": "movement", "workflow": "single", "trajectories": 2, "rounds": 0}


@pytest.mark.slow
def test_a_design_runs_to_its_end_and_the_command_line_reads_it(
    browser: Browser, runs: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    name = browser.post("/api/designs", {**FORM, "seed": 3})["run"]
    assert name in {row["run"] for row in browser.get("/api/runs")}
    until(lambda: not browser.get("/api/designs")[0]["running"])
    assert browser.get("/api/designs") == [
        {"run": name, "running": False, "problem": "", "form": {**FORM, "seed": 3}}
    ]
    assert main(["show", str(runs / name), "--json"]) == 0
    details = json.loads(capsys.readouterr().out)
    assert (details["task"], details["workflow"], details["seed"]) == ("movement", "single", 3)
    assert details["score"] > 0


@pytest.mark.slow
def test_a_design_is_stopped_and_can_be_resumed(browser: Browser, runs: Path) -> None:
    form = {"task": "throwing", "trajectories": 8, "rounds": 50}
    name = browser.post("/api/designs", form)["run"]
    assert state_of(runs / name) == "running"
    until(lambda: (runs / name / "events.jsonl").read_bytes().count(b"\n") > 1)
    browser.post("/api/designs/stop", {"run": name})
    [told] = browser.get("/api/designs")
    assert (told["running"], told["problem"]) == (False, "")
    assert (state_of(runs / name), row_of(browser, name)["state"]) == ("stopped", "stopped")
    browser.post("/api/designs/resume", {"run": name})
    until(lambda: state_of(runs / name) == "running")
    assert row_of(browser, name)["problem"] == ""


def test_a_complete_run_is_not_resumed(browser: Browser) -> None:
    answer = browser.ask("/api/designs/resume", {"run": "throwing"})
    assert "throwing is not stopped" in answer.text


def test_a_run_that_sends_prompts_elsewhere_is_not_resumed_unasked(
    browser: Browser, runs: Path
) -> None:
    config = load_config(
        None,
        ("model.base_url=http://models.example.org/v1",),
        {"task": "movement", "model.name": "gpt"},
    )
    RunDirectory.create(runs, "foreign", RunPlan.of(config).run_document).close()
    answer = browser.ask("/api/designs/resume", {"run": "foreign"})
    assert "sends prompts to http://models.example.org" in answer.text


@pytest.mark.slow
def test_a_design_that_fails_stays_in_the_list_with_its_reason_and_form(
    browser: Browser, runs: Path
) -> None:
    form = {**FORM, "model": "gpt", "base_url": "http://127.0.0.1:9/v1"}
    name = browser.post("/api/designs", form)["run"]
    last = list(news(browser, run=name))[-1]
    assert (last["state"], last["ended"]) == ("failed", True)
    assert "connection refused" in last["problem"]
    assert "--" not in last["problem"]
    assert not (runs / name).exists()
    row = row_of(browser, name)
    assert (row["state"], row["problem"], row["task"]) == ("failed", last["problem"], "movement")
    assert browser.get("/api/designs")[0]["form"] == form


def test_a_run_that_is_deleted_while_it_is_watched_says_so(browser: Browser, runs: Path) -> None:
    (runs / "throwing" / "result.json").unlink()
    stream = news(browser, run="throwing")
    assert next(stream)["state"] == "stopped"
    shutil.rmtree(runs / "throwing")
    assert [(told["state"], told["problem"]) for told in stream] == [
        ("gone", "the folder of this run was deleted")
    ]


@pytest.mark.slow
def test_a_key_is_in_no_answer_and_in_no_file(
    runs: Path, monkeypatch: pytest.MonkeyPatch, stub_url: str
) -> None:
    key = "sk-secret-of-the-studio"
    monkeypatch.setenv("OPENAI_API_KEY", key)
    with studio(runs) as served:
        browser = served.enter()
        answer = browser.ask(
            "/api/designs", {**FORM, "model": "gpt", "base_url": stub_url, "calls": 2}
        )
        told = [answer.text, json.dumps(browser.get("/api/start"))]
        until(lambda: not any(item["running"] for item in browser.get("/api/designs")))
        told.append(json.dumps(browser.get("/api/designs")))
    files = [path.read_bytes() for path in runs.rglob("*") if path.is_file()]
    assert all(key not in text for text in told)
    assert all(key.encode() not in content for content in files)


@pytest.mark.slow
def test_the_command_prints_one_address_that_opens_once(tmp_path: Path) -> None:
    command = [sys.executable, "-c", "import sys; from agentflow.cli import main; sys.exit(main())"]
    process = subprocess.Popen(
        [*command, "studio", "--runs", str(tmp_path)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": os.getcwd()},
    )
    try:
        assert process.stdout is not None
        address = process.stdout.readline().strip()
        assert address.startswith("http://127.0.0.1:")
        assert httpx.get(address, trust_env=False).status_code == 303
        assert httpx.get(address, trust_env=False).status_code == 403
    finally:
        process.send_signal(2)
        _, said = process.communicate(timeout=60)
    assert said == ""
    assert process.returncode == 0
