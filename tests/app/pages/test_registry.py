"""Pages by name."""

from __future__ import annotations

from pathlib import Path

import pytest

from agentflow.app.pages.registry import PAGES
from agentflow.cli import main

RECORDED = Path(__file__).parents[3] / "runs/recorded-throwing"


@pytest.mark.parametrize("name", PAGES)
def test_every_page_is_a_function(name: str) -> None:
    assert callable(PAGES[name])


def test_an_unknown_page_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = str(tmp_path / "report.html")
    assert main(["report", str(RECORDED), "--out", out, "--page", "rnu"]) == 2
    assert capsys.readouterr().err == "agentflow: unknown page 'rnu'; known: run, sweep, training\n"
