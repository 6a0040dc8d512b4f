"""The tutorial on training does what it says, from data to a design, with PyTorch."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.test_documented import ELSEWHERE, follow


@pytest.mark.training
@pytest.mark.slow
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("page", ELSEWHERE)
def test_commands_run_as_written(
    page: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    follow(page, tmp_path, monkeypatch, capfd)
