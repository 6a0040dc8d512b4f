"""Everything that CONTRIBUTING.md says how to add is added to a copy of the package, and used.

The copy is edited in the places that its entry names, and in no others. Things that other
distributions can add are used that way in tests/test_plugins.py.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

from tests.adding.edits import ADDITIONS, EDITS, TOUCHED
from tests.processes import run_python

ROOT = Path(__file__).parents[2]
CAR = ROOT / "examples" / "car.json"


def entries() -> dict[str, list[str]]:
    """Entry of "To add something" -> files of the package that it names, in order."""
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    section = text.split("## To add something\n", 1)[1].partition("\n## ")[0]
    _, *found = re.split(r"^\*\*(.+?)\*\*(?= \()", section, flags=re.MULTILINE)
    return {
        name: re.findall(r"`agentflow/([^`]+)`", entry)
        for name, entry in zip(found[::2], found[1::2], strict=True)
    }


def is_like(new: str, named: str) -> bool:
    """Whether a new file is such as a named one: in its folder, or in a new folder beside its."""
    ours, theirs = Path(new).parts, Path(named).parts
    at = next(
        i for i, _ in enumerate(ours) if not (ROOT / "agentflow" / Path(*ours[: i + 1])).exists()
    )
    return (ours[:at], len(ours), Path(new).suffix) == (
        theirs[:at],
        len(theirs),
        Path(named).suffix,
    )


@pytest.mark.parametrize("name", TOUCHED)
def test_an_entry_names_the_places_that_adding_touches_and_no_others(name: str) -> None:
    named, touched = entries()[name], TOUCHED[name]
    new = [path for path in touched if f"agentflow/{path}" not in EDITS]
    assert [path for path in new if not any(is_like(path, each) for each in named)] == []
    assert [path for path in touched if path not in (*new, *named)] == []
    used = {each for each in named if each in touched or any(is_like(path, each) for path in new)}
    assert [each for each in named if each not in used] == []


def test_there_is_an_addition_for_each_entry_and_no_other() -> None:
    assert list(entries()) == list(TOUCHED)
    every = {f"agentflow/{path}" for paths in TOUCHED.values() for path in paths}
    files = {
        path.relative_to(ADDITIONS).as_posix() for path in ADDITIONS.rglob("*") if path.is_file()
    }
    assert {path for path in files if "__pycache__" not in path} | set(EDITS) == every


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a copy of the package to which everything is added."""
    root = tmp_path_factory.mktemp("copy")
    ignored = shutil.ignore_patterns("__pycache__")
    shutil.copytree(ROOT / "agentflow", root / "agentflow", ignore=ignored)
    shutil.copytree(ADDITIONS, root, ignore=ignored, dirs_exist_ok=True)
    for path, edits in EDITS.items():
        text = (root / path).read_text(encoding="utf-8")
        for before, after in edits:
            assert text.count(before) == 1, (path, before)
            text = text.replace(before, after)
        (root / path).write_text(text, encoding="utf-8")
    return root


@pytest.fixture(scope="module")
def found(copy: Path) -> dict[str, Any]:
    """What came of each new part."""
    paths = os.pathsep.join(map(str, (copy, ROOT)))
    program = Path(__file__).with_name("use.py")
    done = run_python("-W", "error", program, CAR, cwd=copy, PYTHONPATH=paths)
    return dict(json.loads(done.stdout.splitlines()[-1]))


USED: dict[str, object] = {
    "Task family": ["strolling", "stroll along z+"],
    "Block type": ["Kite", "24 Kite: Structure, 1 x 1 x 1, 0.5 kg"],
    "Role": ["env_feedback", 56],
    "Prompt set": "JUDGE THE MACHINE IN ONE SENTENCE!\n",
    "Search strategy": "eager",
    "Workflow": "judged",
    "Tool": "It weighs 5.25 kg.",
    "Function test": ["its Starting Block stays within 5 m", True],
    "Metric": "number of runs",
    "Advantage": [-1.0, 0.0, 7.0],
    "Page": True,
    "Chart": 2,
    "Model client": "a car",
}
"""Entry -> what comes of its addition, where that is the same with every engine."""


@pytest.mark.slow
def test_each_addition_works(found: dict[str, Any]) -> None:
    assert list(found) == list(TOUCHED)
    assert {name: found[name] for name in USED} == USED
    losses, status, aside = found["Block behaviour"]
    assert (losses, status) == (["the pull of kites"], "ok")
    assert aside > 0.5
    assert found["Physics engine"].startswith("tick ")
    assert found["Command"].endswith(" blocks\n")
    assert found["Adapter"] < -20
    ((sentence,), remarks) = found["Kind of event"]
    assert re.fullmatch(r"A (good|fine) machine of \d+ blocks\.", sentence)
    assert remarks == [sentence]


def test_pages_show_what_was_added(copy: Path) -> None:
    node = shutil.which("node")
    if node is None:
        pytest.skip("needs node")
    script = Path(__file__).with_name("pages.mjs")
    command = [node, str(script), str(copy / "agentflow" / "report" / "web")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == {"page": ["Score 7"], "discs": ["3"]}
