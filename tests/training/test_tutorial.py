"""The tutorial on training does what it says, from data to a design, with PyTorch."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.test_documented import ELSEWHERE, follow


@pytest.mark.training
@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_a_model_learns_to_write_valid_machines(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    (page,) = ELSEWHERE
    follow(page, tmp_path, monkeypatch, capfd)
    assert len((tmp_path / "set" / "train.jsonl").read_text().splitlines()) == 37
    measured = json.loads((tmp_path / "before" / "evaluation.json").read_text())
    assert measured["results"]["movement"]["valid"]["count"] > 0
    assert (tmp_path / "runs" / "trained" / "result.json").exists()
