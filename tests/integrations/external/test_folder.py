"""What a program finds in its folder."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from agentflow.integrations.external.folder import (
    Assignment,
    remove_folder,
    task_text,
    write_folder,
)
from agentflow.machine.tree import ROOT, Machine
from agentflow.runs.locations import BLIND, INITIAL
from agentflow.tools import ToolSpec

CHECK = ToolSpec("check", "Check a machine.", {})


def assignment(limit: float = 1800.0, **before: Machine) -> Assignment:
    return Assignment(BLIND if before else INITIAL, "## Task\nDrive.\n", [CHECK], limit, before)


def test_everything_is_there(tmp_path: Path) -> None:
    root = Machine((ROOT,))
    write_folder(tmp_path, assignment(abcd1234=root), "http://127.0.0.1:1/mcp", "secret")
    found = sorted(str(file.relative_to(tmp_path)) for file in tmp_path.rglob("*"))
    before = "machines/before"
    assert found == [".mcp.json", "TASK.md", "machines", before, f"{before}/abcd1234.json"]
    assert json.loads((tmp_path / before / "abcd1234.json").read_text()) == root.to_json()
    assert json.loads((tmp_path / ".mcp.json").read_text())["mcpServers"] == {
        "agentflow": {
            "type": "http",
            "url": "http://127.0.0.1:1/mcp",
            "headers": {"Authorization": "Bearer secret"},
        }
    }


def test_the_task_names_stage_tools_and_time() -> None:
    text = task_text(assignment())
    assert text.startswith("# Stage initial\n\nDesign machines. Nothing is simulated")
    assert "- `check`: Check a machine.\n" in text
    assert text.endswith("## Task\nDrive.\n")
    assert "machines/before" not in text
    assert "machines/before" in task_text(assignment(abcd1234=Machine((ROOT,))))


@pytest.mark.parametrize(
    ("limit", "told"), [(90.0, "90 seconds"), (1800.0, "30 minutes"), (3700.0, "61.7 minutes")]
)
def test_how_long_a_program_has(limit: float, told: str) -> None:
    assert f"You are stopped after {told}." in task_text(assignment(limit))


def test_folders_three_thousand_deep_are_removed(tmp_path: Path) -> None:
    made = tmp_path / "made"
    made.mkdir()
    inner = os.open(made, os.O_RDONLY)
    for _ in range(3000):
        os.close(os.open("file", os.O_CREAT | os.O_WRONLY, dir_fd=inner))
        os.mkdir("in", dir_fd=inner)
        outer, inner = inner, os.open("in", os.O_RDONLY, dir_fd=inner)
        os.close(outer)
    os.close(inner)
    (made / "link").symlink_to(tmp_path)
    (made / "closed").mkdir(mode=0)
    remove_folder(made)
    assert list(tmp_path.iterdir()) == []
