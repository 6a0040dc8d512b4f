"""Whether a benchmark ranks: the comparison of stand-ins, and the figures in the documentation."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks import ladder

ROOT = Path(__file__).parents[3]
PAGE = ROOT / "docs" / "results" / "benchmark.md"


def test_rungs_that_differ_everywhere_are_always_in_order() -> None:
    apart = np.array([[0.1, 0.3, 0.9], [0.2, 0.4, 0.8], [0.0, 0.3, 1.0]])
    told = ladder._compare(["a", "b", "c"], apart)
    assert told.startswith("3 items; all 3 rungs in order in 100.0% of")
    equal = np.array([[0.1, 0.1], [0.2, 0.2]])
    assert "in order in 0.0% of" in ladder._compare(["a", "b"], equal)


def test_power_is_that_of_the_normal_approximation() -> None:
    """33 items nearly always show a mean of 0.7 deviations."""
    differences = [0.0, 2**0.5]
    assert ladder._power(differences) == pytest.approx(0.98, abs=0.01)
    assert ladder._power([1.0, 1.0]) == 1
    assert ladder._power([0.0, 0.0]) == 0


def test_the_page_has_the_figures_of_its_command(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    text, shares = PAGE.read_text("utf-8"), []
    monkeypatch.chdir(ROOT)
    for line in text.splitlines():
        if line.startswith("$ python benchmarks/ladder"):
            monkeypatch.setattr(sys, "argv", line.split()[2:])
            ladder.main()
            summary, _, table = capsys.readouterr().out.strip().partition("\n\n")
            assert table in text
            shares.append(summary.partition(" in order in ")[2].partition("%")[0])
    assert shares
    for share in shares:
        assert f"are in order in {share} % of" in text
