"""Families from other distributions: found by entry point, loaded when used, named if broken."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from agentflow.env.tasks import families
from agentflow.env.tasks.registry import FAMILIES
from agentflow.errors import UnknownNameError

FAMILY = """
from dataclasses import dataclass
from typing import ClassVar
from agentflow.env.tasks.families.movement import Movement

@dataclass(frozen=True)
class Sweeping(Movement):
    family: ClassVar[str] = "sweeping"
"""
LEVEL = "family: sweeping\ntitle: a floor\ngood: 10\nparameters:\n  road: {wall_height: 2}\n"


def distribution(folder: Path, points: str, module: str = FAMILY) -> Path:
    """A distribution as pip leaves it, with a module and two levels."""
    package = folder / "broom"
    (package / "levels").mkdir(parents=True)
    package.joinpath("__init__.py").touch()
    package.joinpath("sweeping.py").write_text(module, encoding="utf-8")
    folder.joinpath("alone.py").write_text(module, encoding="utf-8")
    for name in ("sweeping-1.yaml", "sweeping-2.yaml", "other-1.yaml", "readme.txt"):
        (package / "levels" / name).write_text(LEVEL, encoding="utf-8")
    info = folder / "broom-1.0.dist-info"
    info.mkdir()
    info.joinpath("METADATA").write_text("Metadata-Version: 2.1\nName: broom\nVersion: 1.0\n")
    info.joinpath("entry_points.txt").write_text(f"[agentflow.families]\n{points}\n")
    return folder


def told(folder: Path, *names: str) -> subprocess.CompletedProcess[str]:
    """What the command line says of these tasks, one after the other, in a process of its own.

    Its status has a digit for each, that of the first one last.
    """
    run = (
        f"import sys; sys.path.insert(0, {str(folder)!r}); from agentflow.cli import main; "
        f"sys.exit(sum(main(['tasks', name]) * 10**i for i, name in enumerate({names!r})))"
    )
    command = [sys.executable, "-c", run]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.mark.slow
def test_a_family_from_elsewhere_is_one_of_all_beside_a_broken_one(tmp_path: Path) -> None:
    points = "sweeping = broom.sweeping:Sweeping\nmopping = broom.nowhere:Mopping"
    shown = told(distribution(tmp_path, points), "sweeping/2", "mopping")
    assert shown.returncode == 20, shown.stderr
    assert "walls with their inner sides at x = -11.5 m and x = 11.5 m, 2 m high" in shown.stdout
    assert shown.stderr.startswith(
        "agentflow: the task family 'mopping' (broom.nowhere:Mopping) of the distribution 'broom' "
        "cannot be loaded: ModuleNotFoundError: No module named 'broom.nowhere'"
    )


BROKEN = {
    "dividing = broom.dividing:Sweeping": "cannot be loaded: ZeroDivisionError",
    "counting = broom.counting:Sweeping": (
        "is not a subclass of agentflow.env.tasks.family.Family"
    ),
    "sweeping = alone:Sweeping": (
        "is a module outside any package; move it and levels/ into a package"
    ),
    "mopping = broom.sweeping:Sweeping": "has family = 'sweeping'",
}
"""Entry point -> what is wrong with it."""


@pytest.mark.slow
def test_a_broken_one_is_named(tmp_path: Path) -> None:
    folder = distribution(tmp_path, "\n".join(BROKEN))
    (folder / "broom" / "dividing.py").write_text("1 / 0")
    (folder / "broom" / "counting.py").write_text("Sweeping = 7")
    points = [point.split(" = ") for point in BROKEN]
    shown = told(folder, "movement", *(name for name, _ in points))
    assert shown.returncode == 22220 % 256, shown.stderr
    for (name, value), problem, line in zip(
        points, BROKEN.values(), shown.stderr.splitlines(), strict=True
    ):
        start = f"agentflow: the task family {name!r} ({value}) of the distribution 'broom' "
        assert line.startswith(start + problem)


@pytest.mark.slow
def test_a_name_that_is_taken_is_refused_when_others_are_looked_for(tmp_path: Path) -> None:
    folder = distribution(tmp_path, "throwing = broom.sweeping:Sweeping")
    shown = told(folder, "sweeping", "movement")
    assert (shown.returncode, shown.stderr) == (
        2,
        "agentflow: the task family 'throwing' (broom.sweeping:Sweeping) of the distribution "
        "'broom' has the same name as another task family\n",
    )


def test_ours_are_the_modules_of_the_folder() -> None:
    folder = Path(families.__path__[0])
    modules = (path.stem for path in folder.glob("*.py") if path.stem != "__init__")
    assert FAMILIES.ours == tuple(sorted(modules))
    assert tuple(FAMILIES)[: len(FAMILIES.ours)] == FAMILIES.ours
    with pytest.raises(UnknownNameError, match=r"^unknown task family 'juming'; known: jumping, "):
        FAMILIES["juming"]
