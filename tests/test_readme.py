"""Every command line of the README that can run without a key runs as written."""

from __future__ import annotations

import re
import shlex
import shutil
from pathlib import Path

import pytest

from agentflow.cli import main

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text()
LINES = [
    line.partition("#")[0].strip()
    for line in README.splitlines()
    if line.startswith("agentflow ") and "--model" not in line
]


def test_there_are_commands_to_test() -> None:
    assert len(LINES) >= 8


@pytest.mark.slow
@pytest.mark.parametrize("line", LINES)
def test_the_command_runs_as_written(
    line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("examples", "configs", "runs/recorded-throwing"):
        shutil.copytree(ROOT / name, tmp_path / name)
    monkeypatch.chdir(tmp_path)
    assert main(shlex.split(line)[1:]) == 0


@pytest.mark.parametrize("target", sorted(set(re.findall(r"\]\(([^)#]+)\)", README))))
def test_every_link_leads_somewhere(target: str) -> None:
    assert (ROOT / target).exists()
