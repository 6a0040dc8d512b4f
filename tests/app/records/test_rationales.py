"""Designs against the blocks that their rationale counts."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from agentflow.app.records.failures import count_failures
from agentflow.app.records.rationales import counted, unkept
from agentflow.metrics.failures import RATIONALE

RECORDED = Path(__file__).parents[3] / "runs" / "recorded-throwing"
LAST = "designer/structure-4/traj-1/candidate-1/attempt-1"


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("Four Powered Wheels carry 2 logs.", [(2, 4), (63, 2)]),
        ("one small wooden block, then 12 Small Wheels", [(15, 1), (50, 12)]),
        ("a lever 2.5 Logs long, 1.2 Springs", []),
        ("No springs, a Hinge, the third Brace, 3 blocks; 2 Springy things", []),
    ],
)
def test_only_numbers_before_names_count(text: str, found: list[tuple[int, int]]) -> None:
    assert [(kind, count) for kind, count in counted(text)] == found


@pytest.mark.parametrize(
    ("said", "label", "unfollowed"),
    [
        ("Two Springs pull; eight Logs carry.", LAST, False),
        ("Three Springs pull.", LAST, True),
        ("Three Springs will pull.", LAST.replace("structure-4", "structure-3"), False),
        ("```json\n3 Springs\n```\n", LAST, False),
    ],
)
def test_a_design_with_fewer_blocks_than_it_says_is_counted(
    tmp_path: Path, said: str, label: str, unfollowed: bool
) -> None:
    run = tmp_path / "run"
    shutil.copytree(RECORDED, run)
    calls = [json.loads(line) for line in (run / "calls.jsonl").read_text().splitlines()]
    (call,) = (call for call in calls if call["request"]["label"] == label)
    call["reply"]["text"] = f"{said}\n{call['reply']['text']}"
    (run / "calls.jsonl").write_text("".join(json.dumps(call) + "\n" for call in calls))
    assert unkept(run) == (frozenset([label]) if unfollowed else frozenset())
    found = {kind["name"]: kind["count"] for kind in count_failures(run)["kinds"]}
    assert found[RATIONALE.name] == unfollowed
