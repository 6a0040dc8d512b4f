"""The API of building: hostile machines are refused, each test is recorded in its run."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from pathlib import Path
from threading import Thread
from typing import Any

import pytest

from agentflow.app.inspect.overview import run_list
from agentflow.runs import read_events
from tests.machine.builders import CAR, build
from tests.studio.serving import Browser, studio

ROOT = [{"type": 0, "id": 0, "parent": -1, "face_id": -1}]


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("runs")


@pytest.fixture(scope="module")
def browser(runs: Path) -> Iterator[Browser]:
    with studio(runs) as served:
        yield served.enter()


def given(machine: object, **more: object) -> dict[str, Any]:
    return {"task": "movement", "machine": machine, **more}


def test_building_goes_from_the_given_machine_by_edits(browser: Browser) -> None:
    state = browser.get("/api/build/new", task="movement")
    assert state["machine"] == ROOT
    spots = browser.post("/api/build/spots", given(ROOT, add=1))
    assert [(spot["block"], spot["face"]) for spot in spots] == [(0, face) for face in range(6)]
    edited = browser.post("/api/build/edit", given(ROOT, do="add", type=1, ends=[[0, 0]]))
    assert edited["machine"] == build((1, 0, 0)).to_json()
    assert edited["chosen"] == 1
    turned = browser.post("/api/build/edit", given(edited["machine"], do="turn", block=1))
    assert turned["machine"][1]["face_id"] == 1


def test_machines_are_opened_in_every_format(browser: Browser) -> None:
    from agentflow.machine.formats.bsg_writing import to_bsg

    for text, name in ((CAR.to_text(), "car.json"), (to_bsg(CAR), "car.bsg")):
        asked = {"task": "movement", "text": text, "name": name}
        assert browser.post("/api/build/open", asked)["machine"] == CAR.to_json()


def test_what_every_test_would_fail_for_is_told_before_it(browser: Browser) -> None:
    record = browser.get("/api/build/record", task="movement/7")["machine"]
    asked = {"task": "movement/7", "machine": record}
    assert browser.post("/api/build/state", asked)["warnings"] == []
    blocks = record["blocks"]
    turned = {**record, "blocks": [*blocks[:3], {**blocks[3], "face_id": 5}, *blocks[4:]]}
    told = browser.post("/api/build/state", {**asked, "machine": turned})
    assert told["problems"] == []
    message = "Every test fails: its wheels do not turn about one axis along x."
    assert [each["message"] for each in told["warnings"]] == [message]
    alone = browser.post("/api/build/state", {**asked, "machine": ROOT})
    assert (bool(alone["problems"]), alone["warnings"]) == (True, [])


LONG = [*ROOT, *({"type": 1, "id": i, "parent": i - 1, "face_id": 0} for i in range(1, 1001))]


@pytest.mark.parametrize(
    ("path", "data"),
    [
        ("/api/build/state", given([])),
        ("/api/build/state", given(LONG)),
        ("/api/build/state", given([{"type": 0, "id": 0, "parent": -1, "face_id": -1.5}])),
        ("/api/build/state", given([*ROOT, {"type": 1, "id": 1, "parent": 10**30, "face_id": 0}])),
        ("/api/build/state", {"task": "../secret.yaml", "machine": ROOT}),
        ("/api/build/spots", given(ROOT)),
        ("/api/build/spots", given(ROOT, add=10**12)),
        ("/api/build/spots", given(ROOT, move=5)),
        ("/api/build/spots", given(ROOT, add=9, first=[7, 0])),
        ("/api/build/ghost", given(ROOT, end=[0, 0])),
        ("/api/build/ghost", given(ROOT, add=1, end=[0, 99])),
        ("/api/build/ghost", given(ROOT, add=9, end=[0, 0])),
        ("/api/build/edit", given(ROOT, do="fix", block=0)),
        ("/api/build/edit", given(ROOT, do="add", type=1)),
        ("/api/build/edit", given(ROOT, do="add", type=1, ends=[[0, 99]])),
        ("/api/build/edit", given(ROOT, do="add", type=1, ends=[[0, -1]])),
        ("/api/build/edit", given(ROOT, do="add", type=1, ends=[[0]])),
        ("/api/build/edit", given(ROOT, do="add", type=-1, ends=[[0, 0]])),
        ("/api/build/edit", given(ROOT, do="remove", block=0)),
        ("/api/build/edit", given(ROOT, do="copy", block=0, ends=[[0, 0]])),
        ("/api/build/edit", given(ROOT, do="delete everything", block=0)),
        ("/api/build/edit", given(ROOT, do="move", block=9, ends=[[0, 0]])),
        ("/api/build/open", {"task": "movement", "text": "<!DOCTYPE x [<!ENTITY a 'b'>]>"}),
        ("/api/build/open", {"task": "movement", "text": "hello"}),
        ("/api/build/test", given([*ROOT, *ROOT])),
        ("/api/build/finish", {"run": "throwing"}),
    ],
)
def test_what_cannot_be_built_is_refused(browser: Browser, path: str, data: object) -> None:
    answer = browser.ask(path, data)
    assert answer.status_code == 400
    assert answer.json()["problem"]


@pytest.mark.slow
def test_two_tabs_that_test_at_once_write_one_record(browser: Browser, runs: Path) -> None:
    told: list[dict[str, Any]] = []
    other = build((1, 0, 0), (2, 1, 1), (2, 1, 3))
    begun = browser.post("/api/build/test", given(build((1, 0, 0)).to_json()))["run"]

    def test(machine: Any) -> None:
        told.append(browser.post("/api/build/test", given(machine.to_json(), run=begun)))

    tabs = [Thread(target=test, args=(machine,)) for machine in (CAR, other)]
    for tab in tabs:
        tab.start()
    for tab in tabs:
        tab.join()
    [name] = {item["run"] for item in told}
    assert name == begun
    alone = browser.post("/api/build/test", given(other.to_json()))["run"]
    assert alone != name  # nobody asked to join
    page = browser.get("/api/run", run=alone)
    assert (page["run"]["sentence"], page["tools"]) == ("is the best so far", [])
    assert "Resume" not in dict(page["facts"])  # nobody continues a person
    best = max(item["score"] for item in told)
    assert best > 40
    film = browser.post("/api/build/film", given(CAR.to_json()))
    assert film["machine"]["film"]["samples"] > 10
    finished = browser.post("/api/build/finish", {"run": name})
    assert finished == {"run": name, "score": pytest.approx(best)}
    labels = [(event.kind, event.label) for event in read_events(runs / name)]
    assert len(labels) == len(set(labels))
    [row] = [row for row in run_list(runs) if row["run"].endswith(name)]
    assert (row["state"], row["model"], row["score"]) == (
        "done",
        "a person in the studio",
        pytest.approx(best),
    )
    lines = (runs / name / "events.jsonl").read_bytes().splitlines()
    assert all(json.loads(line)["kind"] for line in lines)


@pytest.mark.slow
def test_a_machine_is_handed_to_a_model_and_its_answer_taken(browser: Browser) -> None:
    form = {"task": "movement", "workflow": "single", "trajectories": 1, "rounds": 1}
    name = browser.post("/api/designs", {**form, "machine": CAR.to_json()})["run"]
    while any(item["running"] for item in browser.get("/api/designs")):
        time.sleep(0.2)
    assert browser.get("/api/designs")[0]["problem"] == ""
    answer = browser.get("/api/build/from", run=name)
    assert answer["task"] == "movement"
    state = browser.post("/api/build/state", answer)
    assert state["valid"]
    record = browser.get("/api/run", run=name)
    assert record["nodes"][0]["machine"] == CAR.digest  # where it began
