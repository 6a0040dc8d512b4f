"""What notebooks show: self-contained cells, text only as text, and short words without HTML."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from dataclasses import replace
from html import unescape
from pathlib import Path
from typing import Any

import pytest

import agentflow
from agentflow.env.rollout import Feedback, Rollout
from agentflow.env.verification import Verification
from agentflow.machine import Machine
from agentflow.notebook.display.formatters import SHOWN
from agentflow.notebook.display.html import design_html, to_html, to_png
from agentflow.report import page as pages
from tests.notebook.made import RECORDED
from tests.report.hostile import NASTY

CAR = Machine.from_file(Path(__file__).parents[3] / "examples" / "car.json")
OVERLAPPING = [
    {"type": 0, "id": 0, "parent": -1, "face_id": -1},
    {"type": 2, "id": 1, "parent": 0, "face_id": 0},
    {"type": 2, "id": 2, "parent": 0, "face_id": 3},
]


def frame_data(html: str) -> dict[str, Any]:
    """The data of the page in a frame."""
    found = re.search(r'<iframe srcdoc="([^"]*)" sandbox="allow-scripts allow-downloads"', html)
    assert found is not None
    page = unescape(found[1])
    assert "default-src 'none'" in page
    data = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)
    assert data is not None
    content: dict[str, Any] = json.loads(data[1])
    return content


@pytest.fixture(scope="module")
def rollout() -> Rollout:
    return agentflow.simulate(CAR, "movement", knobs={"window": 1}, interval=0.1)


def test_a_machine_is_the_viewer_and_a_picture() -> None:
    data = frame_data(to_html(CAR))
    assert (data["kind"], data["title"]) == ("cell", f"7 blocks, {CAR.digest}")
    assert len(data["machine"]["solids"]) == 7
    assert data["machine"]["film"]["samples"] == 1
    assert to_png(CAR).startswith(b"\x89PNG")


def test_a_rollout_is_its_film_with_loads_and_events(rollout: Rollout) -> None:
    assert rollout.machine == CAR
    html = to_html(rollout)
    data = frame_data(html)
    assert data["title"] == f"ok, score {rollout.score:.2f}"
    assert data["machine"]["film"]["samples"] >= 10
    assert data["machine"]["film"]["loads"] == 6
    assert "Terms of the score" in html
    refused = to_html(agentflow.simulate(OVERLAPPING, "movement"))
    assert "<iframe" not in refused
    assert "was not simulated" in refused


def test_a_report_lists_its_problems_beside_the_picture() -> None:
    report = agentflow.check(OVERLAPPING, "movement")
    html = to_html(report)
    assert f"{len(report.problems)} problem" in html
    assert all(problem.code in html for problem in report.problems)
    assert 'src="data:image/png;base64,' in html
    assert "valid" in to_html(agentflow.check(CAR, "movement"))
    assert "not_json" in to_html(agentflow.check("nothing"))


def test_a_verification_is_its_spread(rollout: Rollout) -> None:
    scores = {"default": 10.0, "friction -2 %": 9.0, "masses +2 %": 1.0}
    found = Verification({name: replace(rollout, score=score) for name, score in scores.items()})
    html = to_html(found)
    assert "verified score 9.00, from 1.00 to 10.00; holds in 2 of 3, fragile" in html
    assert html.count("does not hold") == 1
    assert repr(found) == "<Verification 9, 1 to 10; holds in 2 of 3, fragile>"
    broken = Verification({"default": replace(rollout, score=None, status="crashed")})
    assert "incomplete" in to_html(broken)
    assert repr(broken) == "<Verification incomplete, 1 simulations>"


def test_a_run_is_its_page_also_where_an_event_loop_runs() -> None:
    import asyncio

    async def in_a_cell() -> str:
        return to_html(agentflow.Run(RECORDED))

    data = frame_data(asyncio.run(in_a_cell()))
    assert data["kind"] == "run"
    assert len(data["nodes"]) == len(agentflow.Run(RECORDED).rows())
    assert data["progress"]


def test_words_of_models_stay_words(rollout: Rollout) -> None:
    told = replace(rollout, trace=None, feedback=Feedback(NASTY, {}), terms={NASTY: NASTY})
    for html in (to_html(told), to_html(NASTY), to_html({"a": "<script>"})):
        assert "<script" not in html
        assert "<img" not in html


def test_without_the_viewer_there_is_the_picture_and_why(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pages, "BUNDLE", tmp_path)
    html = to_html(CAR)
    assert 'src="data:image/png;base64,' in html
    assert "the report player is missing" in html
    assert "the report player is missing" in to_html(agentflow.Run(RECORDED))


def test_tasks_and_designs_say_what_they_are() -> None:
    html = to_html(agentflow.task("throwing"))
    assert "wall.height" in html
    assert "good score" in html
    result = agentflow.Run(RECORDED).result
    found = agentflow.Design(RECORDED, True, 11.0, 10.5, True, CAR, "m", (), None, {"reason": ""})
    assert frame_data(design_html(found))["title"] == "score 11.00, verified 10.50, fragile"
    without = replace(found, machine=None, data={"reason": "no valid machine was found"})
    assert "no valid machine was found" in design_html(without)
    assert result.valid


def test_words_for_consoles_are_short(rollout: Rollout) -> None:
    assert repr(CAR) == f"<Machine {CAR.digest}: 7 blocks>"
    assert repr(rollout) == f"<Rollout ok, score {rollout.score}, 1 s>"
    assert repr(agentflow.check(CAR, "movement")) == "<Report valid>"
    for shown in (CAR, rollout, agentflow.check(OVERLAPPING), agentflow.task("throwing")):
        assert len(repr(shown)) < 400


@pytest.mark.slow
def test_notebooks_are_told_how_to_show_things() -> None:
    code = (
        "from IPython.core.interactiveshell import InteractiveShell\n"
        "shell = InteractiveShell.instance()\n"
        "import sys, agentflow\n"
        "assert 'agentflow.notebook.display.html' not in sys.modules\n"
        f"from agentflow.machine import Machine, check\n"
        f"car = Machine.from_json({CAR.to_json()!r})\n"
        "report = check(car)\n"
        "for shown in (car, report.machine, report):\n"
        "    data, _ = shell.display_formatter.format(shown)\n"
        "    print(sorted(data), len(data['text/plain']))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    both = ["image/png", "text/html", "text/plain"]
    length = len(repr(CAR))
    assert done.stdout.splitlines() == [
        f"{both} {length}",
        f"{both} {length}",
        f"['text/html', 'text/plain'] {len('<Report valid>')}",
    ], done.stderr


@pytest.mark.slow
def test_a_line_of_a_notebook_shows_the_progress() -> None:
    code = (
        "from IPython.core.interactiveshell import InteractiveShell\n"
        "InteractiveShell.instance().kernel = object()\n"
        "import agentflow\n"
        "from agentflow.notebook.display.progress import SweepLine, run_listener\n"
        f"run = agentflow.Run({str(RECORDED)!r})\n"
        "listener = run_listener(None)\n"
        "for event in run.events: listener(event)\n"
        "line = SweepLine(2, lambda told: print('told:', told))\n"
        "line.run_started('a')\n"
        "line.run_failed('a', 'no luck')\n"
        "line.run_finished('b', run.result)\n"
        "line.run_finished('c', run.result)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    result = agentflow.Run(RECORDED).result
    reached = f"{result.calls} calls, {result.rollouts} machines, best score {result.score:.2f}"
    lines = done.stdout.splitlines()
    assert lines[0] == "starting: 0 calls, 0 machines", done.stderr
    assert f"workflow done: {reached}" in lines
    ended = lines.index(f"best machine verified: {reached}")
    assert lines[ended + 1 :] == [
        "0 of 2 runs; a has begun",
        "told: a has failed: no luck",
        f"2 of 2 runs, best score {result.score:.2f}; c is done",
    ]


def test_every_class_that_is_shown_exists() -> None:
    from importlib import import_module

    for module, names in SHOWN.items():
        for name in names:
            assert getattr(import_module(module), name) in to_html.registry, name
