"""run.yaml: damaged and edited files are refused."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from agentflow.errors import RunError
from agentflow.runs import RunDirectory, read_document

CONTENT = {"agentflow": "0.1.0", "config": {"seed": 3, "settings": {"rationales": ["a: b\n"]}}}


@pytest.fixture
def run(tmp_path: Path) -> Path:
    run = RunDirectory.create(tmp_path, "demo", CONTENT)
    run.close()
    return run.path


def test_it_reads_back(run: Path) -> None:
    assert read_document(run) == {"schema": 1, **CONTENT}
    assert (run / "run.yaml").read_text().startswith("schema: 1\n")


def test_reformatting_does_not_break_the_seal(run: Path) -> None:
    document = yaml.safe_load((run / "run.yaml").read_text())
    (run / "run.yaml").write_text("# mine\n" + yaml.safe_dump(document, default_flow_style=True))
    assert read_document(run) == {"schema": 1, **CONTENT}


@pytest.mark.parametrize(
    ("old", "new"),
    [("seed: 3", "seed: 4"), ("seed: 3", "seed: '3'"), ("0.1.0", "0.2.0"), ("seal", "saal")],
)
def test_an_edited_one_is_refused(run: Path, old: str, new: str) -> None:
    file = run / "run.yaml"
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new))
    with pytest.raises(RunError) as caught:
        RunDirectory.resume(run)
    assert str(caught.value) == (
        f"{file} was edited after the run began and no longer matches the recording; restore it, "
        f"or start a new run with: agentflow design --config {file}"
    )
    assert file.read_text() == text.replace(old, new)


@pytest.mark.parametrize("text", ["", "- a", "a: [", "schem: 1", "a: 2001-99-99", "[\n" * 1200])
def test_a_damaged_one_is_refused(run: Path, text: str) -> None:
    (run / "run.yaml").write_text(text)
    with pytest.raises(RunError, match=r"run\.yaml is damaged: expected a mapping with `schema`"):
        read_document(run)


def test_every_truncation_is_refused(run: Path) -> None:
    file = run / "run.yaml"
    text = file.read_bytes()
    for length in range(len(text) - 1):
        file.write_bytes(text[:length])
        with pytest.raises(RunError):
            read_document(run)


def test_other_schemas_and_missing_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(RunError) as caught:
        read_document(tmp_path)
    assert str(caught.value) == f"{tmp_path} is not a run directory: it has no readable run.yaml"
    (tmp_path / "run.yaml").write_text("schema: 99\n")
    with pytest.raises(RunError) as caught:
        read_document(tmp_path)
    assert str(caught.value) == (
        f"{tmp_path} has schema 99, but this version reads only schema 1: use the "
        "agentflow version that wrote it"
    )
