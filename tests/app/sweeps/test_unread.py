"""What the procedural model does not read: it designs the same machines."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
import yaml

from agentflow.app.pages.sweeps import sweep_report
from agentflow.app.sweeps.unread import UNREAD, unread_note, unused_note
from agentflow.app.sweeps.views import view
from agentflow.cli import main
from agentflow.config.sweep import SweepConfig
from tests.app.sweeps.test_tables import sweep
from tests.metrics.events import candidate

NOTE = (
    "The procedural model reads its data from prompts but ignores their wording, so what it "
    "designs does not depend on history or prompts: compare with a language model (--model)."
)
AXES = {"prompts": ["default", "compact"], "how": {"a": {"settings.history": False}, "b": {}}}
OTHERS = {
    "prompts": "compact",
    "brief": "Make it red.",
    "feedback": "basic",
    "representation": "coordinates",
    "refinement": "whole_machine",
    "rationales": ["Like a bow."],
    "drafts": True,
    "inspirations": 1,
    "lessons": True,
    "known_lessons": ["Wheels turn."],
    "simulate_first": True,
    "vision": True,
    "model.sampling.temperature": 0.1,
    "model.sampling.top_p": 0.5,
    "model.sampling.max_tokens": 500,
}
"""Values that differ from the default; all other keys are switches that are on."""


def test_dry_run_and_tables_say_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = sweep(tmp_path, {"a.default.seed-0": [candidate("initial", 1, 2.0)]}, axes=AXES)
    assert NOTE in view(path).notes
    page = sweep_report(path, tmp_path / "page.html").read_text(encoding="utf-8")
    assert page.count(NOTE) == 1
    assert main(["sweep", str(tmp_path / "hand.yaml"), "--dry-run"]) == 0
    assert capsys.readouterr().out.endswith(f"\n{NOTE}\n")
    model = ("--model", "any", "--base-url", "http://localhost:1/v1")
    assert main(["sweep", str(tmp_path / "hand.yaml"), "--dry-run", *model]) == 0
    assert NOTE not in capsys.readouterr().out


@pytest.mark.parametrize(
    ("key", "settings", "named"),
    [
        ("inspector", {}, "inspector changes nothing in the workflow iterative with search.strate"),
        ("inspector", {"search": {"strategy": "mcts"}}, ""),
        ("querier", {}, ""),
        ("local_trials", {}, ""),
    ],
)
def test_axes_that_workflows_do_not_use_are_named(
    key: str, settings: dict[str, object], named: str
) -> None:
    base = {"task": "movement", "workflow": "iterative", "settings": settings}
    values = [1, 2] if key == "local_trials" else [True, False]
    document = {"title": "x", "base": base, "axes": {key: values}, "table": {"metrics": ["mean"]}}
    note = unused_note(SweepConfig.model_validate(document))
    assert note.startswith(named)
    assert bool(note) == bool(named)


def test_what_it_reads_is_not_named() -> None:
    same = {"x": {"prompts": "default"}, "y": {"prompts": "default"}}
    document = {"axes": {"search.rounds": [1, 2], "c": same}, "table": {"metrics": ["mean"]}}
    assert unread_note(SweepConfig.model_validate({"title": "x", **document})) == ""


@pytest.mark.slow
def test_it_designs_the_same_machines_whatever_they_are(tmp_path: Path) -> None:
    small = {"trajectories": 1, "search": {"rounds": 1, "width": 2}}
    base = {"task": "movement", "workflow": "hierarchical", "verify": False, "settings": small}
    variants = {key.replace(".", "-"): {key: OTHERS.get(key, False)} for key in sorted(UNREAD)}
    document = {
        "title": "Unread",
        "base": base,
        "axes": {"key": {"none": {}, "sampling": {"model.sampling.seed": 7}, **variants}},
        "table": {"metrics": ["mean"]},
    }
    (tmp_path / "unread.yaml").write_text(yaml.safe_dump(document))
    assert main(["sweep", str(tmp_path / "unread.yaml"), "--quiet", "--out", str(tmp_path)]) == 0
    runs = tmp_path / "unread" / "runs"
    made = {run.name: set(os.listdir(run / "machines")) for run in runs.iterdir()}
    usual = made.pop("none.seed-0")
    assert len(usual) > 2
    assert [name for name, machines in made.items() if machines != usual] == ["sampling.seed-0"]
