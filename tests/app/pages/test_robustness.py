"""The figure of how robust a machine is."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from agentflow.app.pages.robustness import kept_figure, page_writer, robustness_figure
from agentflow.app.subjects.robustness import KEPT
from agentflow.cli import main
from agentflow.errors import RunError, UsageError
from tests.app.pages.test_runs import RECORDED
from tests.machine.builders import CAR, build


def simulated(variation: str, score: float | None) -> dict[str, Any]:
    return {
        "variation": variation, "status": "ok" if score is not None else "crashed", "score": score
    }  # fmt: skip


FOUND: dict[str, Any] = {
    "task": "movement",
    "seed": 0,
    "engine": "pybullet 3.2.7",
    "machine": CAR.to_json(),
    "score": 40.0,
    "robust": 36.0,
    "conditions": [
        simulated("default", 40.0),
        simulated("2 x step rate", 41.0),
        simulated("masses +10 %", 38.0),
        simulated("masses -10 %", 42.0),
        simulated("motor speed +10 %", None),
    ],
    "others": [{"engine": "mujoco 4.0.1", "status": "ok", "score": 39.0}],
    "edits": {"scores": [40.0, 10.0], "kept": 0.5, "missing": 1},
    "blocks": [{"block": 5, "name": "Powered Wheel", "mean": 10.0}],
    "faces": [{"block": 2, "name": "Wooden Block", "face": 1, "mean": 10.0}],
    "problems": [],
}


def test_scores_are_grouped_by_what_was_varied() -> None:
    rows = robustness_figure(FOUND)["rows"]
    assert [(row["name"], row["values"], row["mean"], row["failed"]) for row in rows] == [
        ("step rate", [41.0], 41.0, 0),
        ("masses", [38.0, 42.0], 40.0, 0),
        ("motor speed", [], None, 1),
        ("engine", [39.0], 39.0, 0),
        ("design, one edit", [40.0, 10.0], 25.0, 1),
    ]


def test_the_most_sensitive_block_is_drawn() -> None:
    assert robustness_figure(FOUND)["picture"].startswith("data:image/png;base64,")
    assert robustness_figure({**FOUND, "blocks": [], "faces": []})["picture"] is None


def test_a_page_is_checked_before_the_work_and_holds_the_figure(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no such directory"):
        page_writer(tmp_path / "missing" / "page.html")
    page_writer(tmp_path / "page.html")(FOUND)
    text = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert '"robustness"' in text
    assert '"design, one edit"' in text


def test_a_run_without_a_result_has_no_figure(tmp_path: Path) -> None:
    assert kept_figure(tmp_path, CAR) is None
    assert kept_figure(tmp_path, None) is None


@pytest.mark.parametrize(
    "kept",
    [
        "not JSON",
        "[]",
        json.dumps({**FOUND, "score": "high"}),
        json.dumps({**FOUND, "blocks": [{"block": 99, "name": "", "mean": 0.0}]}),
        json.dumps({**FOUND, "machine": build((2, 0, 2)).to_json()}),
    ],
)
def test_a_damaged_result_is_named(tmp_path: Path, kept: str) -> None:
    (tmp_path / KEPT).write_text(kept, encoding="utf-8")
    with pytest.raises(RunError, match="is damaged, or about another machine; make it again"):
        kept_figure(tmp_path, CAR)


@pytest.mark.slow
def test_the_report_of_a_run_shows_how_robust_its_best_machine_is(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = shutil.copytree(RECORDED, tmp_path / "run")
    assert main(["robustness", str(run), "--n", "1", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["task"], found["edits"]["count"]) == ("throwing", 1)
    assert main(["report", str(run), "--films", "0"]) == 0
    assert '"robust"' in (run / "report.html").read_text(encoding="utf-8")
