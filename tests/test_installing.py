"""No line in the repository installs the other distribution, which is called `agentflow`.

`tests/test_release.py` tries the lines that are shown.
"""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

from agentflow.extras import DISTRIBUTION
from tests.install_lines import install_lines

ROOT = Path(__file__).parent.parent
NAME = r"""["']?agentflow(?![\w./-])"""
"""`agentflow` as the whole name of a distribution."""
TAKES = r"(?:pip3?|uv|pipx|conda|poetry|pdm) (?:\S+ )*?(?:install|add|download|--with|--from)|uvx"
"""What comes before the names of distributions."""
WRONG = re.compile(
    r"\bagentflow\[(?=\w)"
    rf"|\b(?:{TAKES}) (?:[^`;&|#\n]* )?{NAME}"
    r"|\bagentflow ?(?:===?|~=|>=|<=?|!=) ?\d"
    r"""|^dependencies\b.*["']agentflow["']""",
    re.MULTILINE,
)


def wrong_lines(text: str) -> list[tuple[int, str]]:
    """Number and content of each line that takes `agentflow` for the name of our distribution."""
    starts = (match.start() for match in WRONG.finditer(text))
    return [(text.count("\n", 0, at) + 1, text[at:].partition("\n")[0]) for at in starts]


@pytest.mark.parametrize(
    "line",
    [
        "pip install agentflow",
        "python3 -m pip install -U 'agentflow>=0.1'",
        "`pip install --quiet agentflow`",
        "pip install 'agentflow[train]'",
        "uv add agentflow",
        "uv pip install agentflow",
        "uv run --with agentflow agentflow tasks",
        "uvx agentflow design",
        "pipx install agentflow",
        "agentflow==0.1.0",
        'dependencies = ["agentflow"]',
    ],
)
def test_a_wrong_line_is_found(line: str) -> None:
    assert wrong_lines(f"# First\n{line}\n")[0][0] == 2


@pytest.mark.parametrize(
    "line",
    [
        "pip install agentflow-machines",
        "pip install 'agentflow-machines[train]'  # in the environment that holds agentflow",
        "pip uninstall agentflow",
        "pip install -e . && agentflow tasks",
        "uv add agentflow-machines",
        "pip install --no-deps examples/pushing",
        'dependencies = ["agentflow-machines"]',
    ],
)
def test_a_right_line_is_not_found(line: str) -> None:
    assert wrong_lines(line) == []


def test_no_line_installs_the_other_distribution() -> None:
    listed = ("git", "ls-files", "--cached", "--others", "--exclude-standard")
    names = subprocess.check_output(listed, cwd=ROOT, text=True).splitlines()
    own = Path(__file__).relative_to(ROOT).as_posix()
    found = []
    for name in names:
        path = ROOT / name
        if name == own or name.startswith("runs/") or not path.is_file():
            continue
        content = path.read_bytes()
        if b"\0" not in content:
            lines = wrong_lines(content.decode())
            found += [f"{name}:{number}: {line}" for number, line in lines]
    assert found == []


def test_documents_show_how_to_install() -> None:
    lines = install_lines()
    assert ("-e", ".") in lines
    assert (DISTRIBUTION,) in lines
    assert len(lines) >= 12
