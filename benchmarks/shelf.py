"""Reads and writes tests/machines/<family>.yaml, which list reference machines and cheats.

What is found and simulated is references.py's and the tests'.
"""

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
"""Decimals of a score that are kept."""
HEAD = """\
# References: machine and picture are files of this folder; score is what
# `benchmarks/references.py --update` got on the platform named here; how: by hand or by search;
# intended: whether it does the job in the intended way, by the look of its film.
# Cheats: the machine must not score more than `most` at any of the levels.
"""


class Reference(BaseModel):
    """A machine that shows that a level can be solved."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    level: str
    """A shipped level, as `--task` takes it."""
    machine: str
    score: float
    how: str
    intended: bool
    picture: str


class Cheat(BaseModel):
    """A machine that tries to fool the score of some levels."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    machine: str
    levels: tuple[str, ...]
    why: str
    """What it tries."""
    most: float = 0.0
    """In the unit of the score; what settling contacts move is more than 0."""


class Shelf(BaseModel):
    """One family's file."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    family: str
    platform: str
    references: tuple[Reference, ...] = ()
    cheats: tuple[Cheat, ...] = ()


def here() -> str:
    """What scores depend on besides machine, task and seed; equal words, equal bits."""
    packages = ", ".join(f"{name} {version(name)}" for name in ("pybullet", "numpy"))
    return f"{platform.system()} {platform.machine()}, {packages}"


def families() -> tuple[str, ...]:
    """The families that have a file."""
    return tuple(sorted(path.stem for path in FOLDER.glob("*.yaml")))


def read(family: str) -> Shelf:
    """A family's file.

    Raises:
        OSError, yaml.YAMLError, pydantic.ValidationError: there is none, or none of this form.
    """
    text = (FOLDER / f"{family}.yaml").read_text(encoding="utf-8")
    return Shelf.model_validate(yaml.safe_load(text))


def write(shelf: Shelf) -> None:
    """Keep a family's file."""
    data = shelf.model_dump(mode="json", exclude_defaults=True)
    text = yaml.safe_dump(data, sort_keys=False, allow_unicode=True, width=100)
    (FOLDER / f"{shelf.family}.yaml").write_text(HEAD + text, encoding="utf-8")


def load(name: str) -> Machine:
    """The machine of a file, by its path in the folder.

    Raises:
        ValueError: it holds no machine.
    """
    return load_file(FOLDER / name)


def load_file(path: Path) -> Machine:
    """The machine of a file.

    Raises:
        ValueError: it holds no machine.
    """
    reading = read_machine(path.read_text(encoding="utf-8"), range(1000))
    if reading.machine is None:
        raise ValueError(f"{path}: {reading.problems[0].message}")
    return reading.machine
