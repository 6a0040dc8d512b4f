"""ELAN files: opened by pympi, and valid against the schema of the format."""

from __future__ import annotations

import subprocess
from pathlib import Path
from xml.etree import ElementTree

import pympi
import pytest

from agentflow.cli import main
from agentflow.models.completion import complete_config
from agentflow.study.elan import write_elan
from agentflow.study.segments import segment
from agentflow.study.session import Session
from tests.llm.foreign import foreign_python
from tests.study.example import TRANSCRIPT, record

HOSTILE = "</ANNOTATION_VALUE><script>&\x00\x1b[2J\ud7ff\U0001f600 ]]>"


@pytest.fixture
def session(tmp_path: Path) -> Session:
    return record(tmp_path / "one")


def test_every_level_has_a_tier(session: Session, tmp_path: Path) -> None:
    transcript = tmp_path / "said.vtt"
    transcript.write_text(TRANSCRIPT)
    segment(session.path, transcript, complete_config({}))
    eaf = pympi.Eaf(str(write_elan(session, tmp_path / "one.eaf")))
    shown = {name: eaf.get_annotation_data_for_tier(name) for name in eaf.get_tier_names()}
    assert list(shown) == [
        *("labels", "episodes", "speech", "notes", "actions", "trials", "pauses", "recordings"),
    ]
    assert shown["labels"][:4] == [
        (0, 10000, "Plan"),
        (10000, 17000, "Build"),
        (17000, 22000, "Test"),
        (22000, 23000, "Observe"),
    ]
    assert (51000, 54000, "break") in shown["episodes"]
    assert shown["speech"][0] == (24000, 26000, "It turns because only one side drives.")
    assert shown["notes"] == [(36000, 36500, "It will go farther with four wheels.")]
    assert [text for _, _, text in shown["actions"]] == [
        *("add", "add", "add", "add", "watch", "add", "add", "new", "add", "add"),
    ]
    assert shown["trials"][1] == (38000, 40000, "simulate: score 3.00")
    assert (51000, 54000, "break") in shown["pauses"]
    assert shown["recordings"] == []
    assert set(eaf.get_cv_entries("labels")) >= {"cve_Plan", "cve_Query"}


def test_a_file_is_the_same_each_time_and_replaces_the_old_one(
    session: Session, capsys: pytest.CaptureFixture[str]
) -> None:
    file = session.path / "session.eaf"
    assert main(["study", "elan", str(session.path)]) == 0
    assert capsys.readouterr().out == f"{file}\n"
    first = file.read_bytes()
    assert main(["study", "elan", str(session.path)]) == 0
    assert file.read_bytes() == first
    assert {item.name for item in session.path.iterdir()} == {"session.jsonl", "session.eaf"}


def test_what_overlaps_in_a_tier_is_separated(tmp_path: Path) -> None:
    lines = (record(tmp_path / "one").path / "session.jsonl").read_text().splitlines()
    folder = tmp_path / "two"
    folder.mkdir()
    for at in (36.0, 36.2):
        lines.append(f'{{"kind": "note", "at": {at}, "text": "another"}}')
    (folder / "session.jsonl").write_text("\n".join(lines) + "\n")
    assert main(["study", "elan", str(folder)]) == 0
    eaf = pympi.Eaf(str(folder / "session.eaf"))
    assert sorted(eaf.get_annotation_data_for_tier("notes")) == [
        (36000, 36001, "It will go farther with four wheels."),
        (36001, 36200, "another"),
        (36200, 36700, "another"),
    ]


def test_hostile_text_stays_text(tmp_path: Path) -> None:
    file = write_elan(record(tmp_path / "one", note=HOSTILE), tmp_path / "one.eaf")
    (note,) = pympi.Eaf(str(file)).get_annotation_data_for_tier("notes")
    assert note[2] == "</ANNOTATION_VALUE><script>&\ufffd\ufffd[2J\ud7ff\U0001f600 ]]>"
    assert ElementTree.parse(file).getroot().find(".//script") is None


@pytest.mark.slow
@pytest.mark.parametrize("version", ["2.8", "3.0"])
def test_a_file_is_valid_against_the_schema(tmp_path: Path, version: str) -> None:
    python = foreign_python(".venv-elan")
    schema = python.parents[1] / f"EAFv{version}.xsd"
    file = write_elan(record(tmp_path / "one", note=HOSTILE), tmp_path / "one.eaf")
    broken = tmp_path / "broken.eaf"
    broken.write_text(file.read_text().replace('LINGUISTIC_TYPE_REF="labels"', "", 1))
    check = (
        "import sys; from lxml import etree; s = etree.XMLSchema(file=sys.argv[1]); "
        "print(*(s.validate(etree.parse(f)) for f in sys.argv[2:]), s.error_log)"
    )
    command = [str(python), "-c", check, str(schema), str(file), str(broken)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env={})
    assert done.stdout.startswith("True False"), done.stdout + done.stderr
