"""Reads and writes tests/machines/<family>.yaml, which list reference machines and cheats."""

from __future__ import annotations

import platform
from importlib.metadata import version
from pathlib import Path

import yaml
from pydantic import BaseModel, ConfigDict

from agentflow.machine.formats.parse import read_machine
from agentflow.machine.tree import Machine

FOLDER = Path(__file__).parent.parent / "tests" / "machines"
DIGITS = 6
"""Decimals of the scores in the files."""
IDLE = 0.02
"""Share of the good score that contacts may move with power off."""
HEAD = """\
# References: machine and picture are files in this folder; score was computed by
# `benchmarks/references.py --update` on this platform; how: by hand or by search;
# intended: whether its film shows that it solves the task in the intended way.
# Cheats: the machine must not score more than `most` on any of the levels.
"""


class Reference(BaseModel):
    """A machine that proves a level solvable."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    level: str
    """A shipped level, as `--task` takes it."""
    machine: str
    score: float
    how: str
    intended: bool
    picture: str


class Cheat(BaseModel):
    """A machine that tries to exploit the score of some levels."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    machine: str
    levels: tuple[str, ...]
    why: str
    """What it exploits."""
    most: float = 0.0
    """Highest acceptable score; more than 0 if settling contacts move it a little."""


class Shelf(BaseModel):
    """One family's file."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    family: str
    platform: str
    references: tuple[Reference, ...] = ()
    cheats: tuple[Cheat, ...] = ()


def here() -> str:
    """Platform and package versions; where they are equal, scores are bitwise equal."""
    packages = ", ".join(f"{name} {version(name)}" for name in ("pybullet", "numpy"))
    return f"{platform.system()} {platform.machine()}, {packages}"


def families() -> tuple[str, ...]:
    """Families that have a file."""
    return tuple(sorted(path.stem for path in FOLDER.glob("*.yaml")))


def read(family: str) -> Shelf:
    """Read a family's file."""
    text = (FOLDER / f"{family}.yaml").read_text(encoding="utf-8")
    return Shelf.model_validate(yaml.safe_load(text))


def write(shelf: Shelf) -> None:
    """Write a family's file."""
    data = shelf.model_dump(mode="json", exclude_defaults=True)
    text = yaml.safe_dump(data, sort_keys=False, allow_unicode=True, width=100)
    (FOLDER / f"{shelf.family}.yaml").write_text(HEAD + text, encoding="utf-8")


def load(name: str) -> Machine:
    """Load a machine by its path in the folder.

    Raises:
        ValueError: The file contains no machine.
    """
    return load_file(FOLDER / name)


def load_file(path: Path) -> Machine:
    """Load a machine.

    Raises:
        ValueError: The file contains no machine.
    """
    reading = read_machine(path.read_text(encoding="utf-8"), range(1000))
    if reading.machine is None:
        raise ValueError(f"{path}: {reading.problems[0].message}")
    return reading.machine
