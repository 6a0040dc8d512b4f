"""The notebooks of examples run from top to bottom, and are kept without results."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.loops import for_each

ROOT = Path(__file__).parents[2]
NOTEBOOKS = sorted(ROOT.glob("examples/*.ipynb"))
EXECUTE = """
import sys
import nbformat
from nbclient import NotebookClient
notebook = nbformat.read(sys.argv[1], as_version=4)
try:
    NotebookClient(notebook, timeout=900, kernel_name="python3").execute()
finally:
    nbformat.write(notebook, sys.argv[1])
"""
SHOWN = {
    "first_machine": {"text/html": ("<iframe srcdoc=", "verified score", "problem")},
    "read_a_run": {"text/html": ("<iframe srcdoc=", "<table"), "image/png": ("",)},
    "compare_two_prompts": {"text/html": ("of 6 runs", "<iframe srcdoc="), "image/png": ("",)},
    "train": {"text/html": ("<table",), "image/png": ("",)},
}
"""Notebook -> what its outputs must hold, by kind."""


def content(path: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return found


@for_each(NOTEBOOKS)
def test_notebooks_are_kept_without_results(path: Path) -> None:
    for cell in content(path)["cells"]:
        assert not cell.get("outputs"), path
        assert cell.get("execution_count") is None, path
    assert path.stem in SHOWN


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize("path", [item for item in NOTEBOOKS if item.stem != "train"])
def test_notebooks_run(path: Path, tmp_path: Path) -> None:
    executed(path, tmp_path)


def executed(path: Path, folder: Path) -> None:
    """Execute a copy beside a copy of the recorded runs; its outputs must be what `SHOWN` says."""
    place = folder / "examples"
    place.mkdir()
    shutil.copytree(ROOT / "runs" / "recorded-throwing", folder / "runs" / "recorded-throwing")
    copy = Path(shutil.copy(path, place))
    command = [sys.executable, "-c", EXECUTE, copy.name]
    path_of_ours = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    done = subprocess.run(
        command,
        cwd=place,
        env={**os.environ, "PATH": path_of_ours},  # lines with ! find this agentflow
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    cells = [cell for cell in content(copy)["cells"] if cell["cell_type"] == "code"]
    outputs = [output for cell in cells for output in cell["outputs"]]
    for kind, texts in SHOWN[path.stem].items():
        shown = [
            "".join(output["data"][kind]) for output in outputs if kind in output.get("data", {})
        ]
        for text in texts:
            assert any(text in item for item in shown), (kind, text)
    told = "".join(
        "".join(item.get("text", "")) for item in outputs if item.get("name") == "stderr"
    )
    assert "Traceback" not in told
