"""Processes that we start execute no file of the folder that they are started in."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from agentflow.env.pool.pool import RolloutPool
from agentflow.env.tasks.registry import get_task
from agentflow.interpreter import python_command, python_environment
from agentflow.machine.tree import ROOT, Machine


@pytest.fixture
def hostile(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, whose modules leave a file `ran` when somebody imports them."""
    for name in ("agentflow", "numpy", "signal"):
        (tmp_path / f"{name}.py").write_text(f"open({str(tmp_path / 'ran')!r}, 'w')\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", ["", *sys.path])  # as in a program given by `python -c`
    return tmp_path


async def test_workers_execute_no_file_of_the_current_folder(hostile: Path) -> None:
    async with RolloutPool(1) as pool:
        rollout = await pool.run(Machine((ROOT,)), get_task("movement", {"window": 1}))
    assert rollout.status == "ok"
    assert not (hostile / "ran").exists()


def test_programs_import_from_elsewhere_only(hostile: Path) -> None:
    command = python_command("import sys, numpy, agentflow.cli; print(sys.argv[1:])", "a b")
    done = subprocess.run(
        command, env=python_environment(), capture_output=True, text=True, check=True
    )
    assert done.stdout == "['a b']\n"
    assert not (hostile / "ran").exists()
