"""The command's start: another distribution called `agentflow` is reported, at next to no cost."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from agentflow_command import namesake, warning

ROOT = Path(__file__).parent.parent
START = "import sys; from agentflow_command import main; sys.exit(main())"
VERSION = [START, "--version"]
STRANGER = {
    "agentflow-0.0.2.dist-info/METADATA": "Name: agentflow\nVersion: 0.0.2\n",
    "agentflow-0.0.2.dist-info/RECORD": "agentflow/__init__.py,,\nagentflow/agentflow.py,,\n",
}
"""The files of the other distribution, without its package."""


@pytest.fixture
def packages(tmp_path: Path) -> Path:
    """The folder of packages of a new environment, in which the libraries of this one are found."""
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", tmp_path / "env"], check=True)
    [folder] = (tmp_path / "env").glob("lib/python*/site-packages")
    known = [path for path in sys.path if path.endswith("site-packages")]
    (folder / "libraries.pth").write_text("\n".join(known))
    return folder


def add(packages: Path, files: dict[str, str]) -> None:
    for name, text in files.items():
        (packages / name).parent.mkdir(exist_ok=True)
        (packages / name).write_text(text)


def command(packages: Path) -> subprocess.CompletedProcess[str]:
    python = packages.parents[2] / "bin" / "python"
    return subprocess.run(
        [python, "-c", *VERSION], cwd=packages, capture_output=True, text=True, check=False
    )


def test_a_distribution_with_files_of_ours_is_reported_and_the_command_still_works(
    packages: Path,
) -> None:
    (packages / "agentflow").symlink_to(ROOT / "agentflow")
    (packages / "agentflow_command.py").symlink_to(ROOT / "agentflow_command.py")
    ours = packages / "agentflow_machines-0.1.0.dist-info"
    ours.mkdir()
    alone = command(packages)
    assert (alone.returncode, alone.stderr) == (0, "")

    add(packages, STRANGER)
    both = command(packages)
    assert both.stderr == f"{warning('agentflow 0.0.2')}\n"
    assert (both.returncode, both.stdout) == (0, alone.stdout)


def test_a_distribution_that_hides_an_editable_installation_is_reported(packages: Path) -> None:
    (packages / "zz_editable.pth").write_text(str(ROOT))
    assert command(packages).stderr == ""

    add(packages, {**STRANGER, "agentflow/__init__.py": "", "agentflow/agentflow.py": ""})
    hidden = command(packages)
    assert hidden.stderr == f"{warning('agentflow 0.0.2')}\n"
    assert (hidden.returncode, hidden.stdout) == (2, "")


@pytest.mark.parametrize(
    ("names", "found"),
    [
        (["agentflow", "agentflow_machines-0.1.0.dist-info"], ""),
        (["agentflow_pushing-0.1.0.dist-info", "agentflow-notes.txt"], ""),
        (["numpy-2.4.6.dist-info", "AgentFlow-0.0.2.dist-info"], "AgentFlow 0.0.2"),
        (["agentflow-0.0.1.egg-info"], "agentflow 0.0.1"),
    ],
)
def test_a_namesake_is_told_from_ours_and_from_extensions(names: list[str], found: str) -> None:
    assert namesake(names) == found


def test_the_report_is_one_line() -> None:
    assert "\n" not in warning("agentflow 0.0.2")


def test_looking_for_it_loads_nothing_else() -> None:
    code = "import sys, {}; print(*sys.modules)"
    bare, start = (
        set(subprocess.check_output([sys.executable, "-c", code.format(name)], text=True).split())
        for name in ("agentflow", "agentflow_command")
    )
    assert start - bare == {"agentflow_command"}
