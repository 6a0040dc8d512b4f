"""Designing with the rationales of another run, which may be deleted afterwards."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from agentflow.app.design.replay import replay
from agentflow.app.design.run import design, rationales_of
from agentflow.config.run import build_config
from agentflow.errors import RunError
from agentflow.runs import read_document

TINY = {"workflow": "single", "settings": {"trajectories": 2, "search": {"rounds": 0}}}


def ignore(_line: str) -> None:
    """Ignores remarks."""


@pytest.mark.slow
def test_rationales_are_followed_and_stored(tmp_path: Path) -> None:
    first = Path(design(build_config(TINY), tmp_path).run)
    plans = rationales_of(first)
    assert len(plans) == 2
    config = build_config({**TINY, "seed": 1, "rationale_from": str(first)})
    second = Path(design(config, tmp_path).run)
    assert read_document(second)["config"]["settings"]["rationales"] == list(plans)
    for line in (second / "calls.jsonl").read_text().splitlines():
        request = json.loads(line)["request"]
        number = int(request["label"].split("traj-")[1].split("/")[0])
        quoted = "\n".join(f"> {line}".rstrip() for line in plans[number - 1].splitlines())
        assert f"## Rationale to follow\n{quoted}\n" in request["messages"][1]["text"]
    shutil.rmtree(first)
    assert replay(second, ignore) is None


@pytest.mark.slow
def test_rationales_of_structures_are_in_build_order(tmp_path: Path) -> None:
    settings = {**TINY["settings"], "inspector": False}  # type: ignore[dict-item]
    run = design(build_config({"workflow": "hierarchical", "settings": settings}), tmp_path)
    plans = rationales_of(Path(run.run))
    assert plans
    assert all(len(plan.splitlines()) > 1 for plan in plans)


@pytest.mark.slow
def test_rationales_need_a_run_with_accepted_designs(tmp_path: Path) -> None:
    with pytest.raises(RunError):
        design(build_config({**TINY, "rationale_from": str(tmp_path / "gone")}), tmp_path)
    nobody = design(
        build_config({"workflow": "random-dsl", "workers": 1, "settings": {"max_simulations": 1}}),
        tmp_path,
    )
    assert nobody.model == "none (random edits)"
    with pytest.raises(
        RunError, match=r" contains no rationale: none of its designs was accepted$"
    ):
        rationales_of(Path(nobody.run))
