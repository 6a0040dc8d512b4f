"""The typed result of a run is exactly what its file holds."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from pydantic import ValidationError

from agentflow.errors import RunError
from agentflow.runs import read_result
from tests.runs.results import a_result

RUNS = Path(__file__).parents[2] / "runs"


@pytest.mark.parametrize("name", ["recorded-throwing", "language-model-throwing"])
def test_a_result_is_written_as_it_was_read(name: str, tmp_path: Path) -> None:
    read_result(RUNS / name).write(tmp_path)
    written, recorded = (folder / "result.json" for folder in (tmp_path, RUNS / name))
    assert written.read_text() == recorded.read_text()


def test_keys_of_other_versions_are_kept(tmp_path: Path) -> None:
    content = {**a_result(score=1.0).to_json(), "mood": "good"}
    (tmp_path / "result.json").write_text(json.dumps(content))
    assert read_result(tmp_path).to_json() == content


def test_a_result_never_changes() -> None:
    with pytest.raises(ValidationError, match="frozen"):
        a_result().score = 2.0  # type: ignore[misc]


def test_the_verified_score_is_trusted_where_there_is_one() -> None:
    scores = [{"variation": "default", "status": "ok", "score": 3.0}]
    plain = a_result(score=3.0)
    verified = plain.with_verification({"score": 2.0, "low": 1.0, "high": 3.0, "scores": scores})
    lost = plain.with_verification({"score": None, "low": None, "high": None, "scores": scores})
    assert [one.trusted_score for one in (plain, verified, lost)] == [3.0, 2.0, 3.0]


@pytest.mark.parametrize("wrong", [{}, [], {"scores": []}, {"score": "much"}])
def test_a_damaged_verification_is_named_as_a_whole(tmp_path: Path, wrong: object) -> None:
    content = {**a_result().to_json(), "verified": wrong}
    (tmp_path / "result.json").write_text(json.dumps(content))
    with pytest.raises(RunError) as caught:
        read_result(tmp_path)
    assert str(caught.value) == (
        f"{tmp_path / 'result.json'} is damaged: its verified is {str(wrong)!r}"
    )
