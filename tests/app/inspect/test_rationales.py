"""Designs against the blocks that their rationale counts."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import pytest

from agentflow.app.inspect.failures import count_blocks, count_failures, unfollowed_rationales
from agentflow.metrics.failure_kinds import RATIONALE

RECORDED = Path(__file__).parents[3] / "runs" / "recorded-throwing"
OF_FIRST = r"^designer/structure-\d+/traj-1/"
LAST, BEFORE = -1, -2
"""Of the structures that a trajectory was built from."""


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("Four Powered Wheels carry 2 logs.", [(2, 4), (63, 2)]),
        ("one small wooden block, then 12 Small Wheels", [(15, 1), (50, 12)]),
        ("a lever 2.5 Logs long, 1.2 Springs", []),
        ("2-3 Logs, up to four Logs, at most 5 Logs, one or two Springs", []),
        ("No springs, a Hinge, the third Brace, 3 blocks; 2 Springy things", []),
    ],
)
def test_only_numbers_before_names_count(text: str, found: list[tuple[int, int]]) -> None:
    assert [(kind, count) for kind, count in count_blocks(text)] == found


@pytest.mark.parametrize(
    ("said", "structure", "unfollowed"),
    [
        ("{has} Logs carry.", LAST, False),
        ("{more} Logs carry.", LAST, True),
        ("{more} Logs will carry.", BEFORE, False),
        ("```json\n{more} Logs\n```\n", LAST, False),
    ],
)
def test_a_design_with_fewer_blocks_than_it_says_is_counted(
    tmp_path: Path, said: str, structure: int, unfollowed: bool
) -> None:
    run = shutil.copytree(RECORDED, tmp_path / "run")
    calls = [json.loads(line) for line in (run / "calls.jsonl").read_text().splitlines()]
    built = [call for call in calls if re.search(OF_FIRST, call["request"]["label"])]
    call = built[structure]
    label = call["request"]["label"]
    has = call["reply"]["text"].count('"type": 63,')
    said = said.format(has=has, more=has + 1)
    call["reply"]["text"] = f"{said}\n{call['reply']['text']}"
    (run / "calls.jsonl").write_text("".join(json.dumps(call) + "\n" for call in calls))
    assert unfollowed_rationales(run) == (frozenset([label]) if unfollowed else frozenset())
    found = {kind["name"]: kind["count"] for kind in count_failures(run)["kinds"]}
    assert found[RATIONALE.name] == unfollowed
