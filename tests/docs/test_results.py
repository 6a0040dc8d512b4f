"""The pages of results say what their scripts would write today."""

from __future__ import annotations

import importlib

import pytest
import yaml

from agentflow.metrics.published import SOURCES
from docs.make.links import ROOT
from docs.make.pages import DOCS


def test_introductions_are_those_of_the_scripts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(ROOT / "benchmarks")  # type: ignore[no-untyped-call]
    sweeps, levels = map(importlib.import_module, ("results", "difficulty"))
    assert (DOCS / "results/published.md").read_text(encoding="utf-8").startswith(sweeps.HEAD)
    intro = levels.INTRO.format(rollouts=levels.ROLLOUTS)
    assert f"\n\n{intro}\n\n" in (DOCS / "results/difficulty.md").read_text(encoding="utf-8")


def test_sections_on_sweeps_describe_them_as_their_files_do() -> None:
    page = (DOCS / "results/published.md").read_text(encoding="utf-8")
    order = importlib.import_module("benchmarks.results").ORDER
    for name in order:
        sweep = yaml.safe_load((ROOT / f"configs/{name}.yaml").read_text(encoding="utf-8"))
        assert f"## {sweep['title']}\n\n{sweep['about']}\n" in page, name
    assert SOURCES["buildarena"] in page
