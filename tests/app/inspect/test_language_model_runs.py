"""Runs of a strong language model, also those recorded by an older version, stay readable.

One ships under `runs/`, to look at. Two are in `recorded/`, without pictures: a small one, and a
large one without saved rollouts, whose machines break rules of today.
"""

from __future__ import annotations

import json
import tarfile
from pathlib import Path

import pytest

from agentflow.cli import main
from agentflow.runs import read_document, read_result

SHIPPED = Path(__file__).parents[3] / "runs" / "language-model-throwing"
RECORDED = Path(__file__).parent / "recorded"
MODEL = "large language model (recorded)"
SCORES = [
    64.69256830771697,
    81.96393508341308,
    80.63936663131483,
    82.33556551768392,
    100.42608066271052,
    100.08084936776177,
]
"""Of its machines, as recorded."""
Captured = pytest.CaptureFixture[str]


def printed(capsys: Captured, *arguments: object) -> str:
    assert main(list(map(str, arguments))) == 0
    return capsys.readouterr().out


@pytest.fixture(params=["gearing-3-placement", "throwing-iterative"])
def older(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """A run as it was recorded."""
    with tarfile.open(RECORDED / f"{request.param}.tar.xz") as archive:
        archive.extractall(tmp_path, filter="data")
    return tmp_path / str(request.param)


def test_the_shipped_run_is_whole_and_names_no_place_on_a_disk() -> None:
    assert read_document(SHIPPED)["config"]["model"]["name"] == MODEL  # its seal holds
    assert read_result(SHIPPED).run == "runs/language-model-throwing"
    for file in SHIPPED.rglob("*.*"):
        content = file.read_bytes()
        assert not any(path in content for path in (b"/home", b"/root", b"/tmp", b"/work"))


def test_lists_and_details_of_the_shipped_run_name_its_model(capsys: Captured) -> None:
    (listed,) = json.loads(printed(capsys, "runs", SHIPPED, "--json"))
    assert (listed["model"], listed["score"], listed["state"]) == (MODEL, SCORES[4], "done")
    assert MODEL in printed(capsys, "runs", SHIPPED)
    assert f"throwing/2, iterative, {MODEL}, seed 0" in printed(capsys, "show", SHIPPED)
    assert "0 of 9 replies rejected; 6 machines" in printed(capsys, "failures", SHIPPED)


@pytest.mark.slow
def test_pages_of_the_shipped_run_name_its_model(tmp_path: Path, capsys: Captured) -> None:
    for command in ("report", "gallery"):
        page = tmp_path / f"{command}.html"
        printed(capsys, command, SHIPPED, "--out", page)
        assert MODEL in page.read_text(encoding="utf-8")


@pytest.mark.slow
@pytest.mark.pybullet
def test_the_shipped_run_is_replayed_identically(capsys: Captured) -> None:
    assert printed(capsys, "replay", SHIPPED).strip() == "identical"


@pytest.mark.slow
def test_the_machines_of_the_shipped_run_score_what_they_did(capsys: Captured) -> None:
    compared = json.loads(printed(capsys, "rescore", SHIPPED, "--json"))
    assert {machine["now"]["score"] for machine in compared["machines"]} == set(SCORES)


@pytest.mark.slow
def test_every_command_reads_a_run_of_an_older_version(
    older: Path, tmp_path: Path, capsys: Captured
) -> None:
    result = read_result(older)
    shown = json.loads(printed(capsys, "show", older, "--json"))
    assert (shown["state"], shown["model"]) == ("done", "large-language-model")
    assert [stage["max"] for stage in shown["stages"]] == [row.max for row in result.stages]
    failed = json.loads(printed(capsys, "failures", older, "--json"))
    assert (failed["replies"], failed["refused"]) == (result.calls, 0)
    compared = json.loads(printed(capsys, "rescore", older, "--json"))
    assert all(one["now"]["status"] == one["recorded"]["status"] for one in compared["machines"])
    assert len(compared["machines"]) == failed["machines"]
    later = [machine["note"] for machine in compared["machines"] if machine["note"]]
    assert len(later) == {"gearing/3": 0, "throwing": 18}[result.task]
    for command in ("report", "gallery"):
        page = tmp_path / f"{command}.html"
        printed(capsys, command, older, "--out", page)
        assert "large-language-model" in page.read_text(encoding="utf-8")
