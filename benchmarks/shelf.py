"""Reads and writes the files of known machines: those of tests/machines, and records."""

from __future__ import annotations

import json
import platform
from importlib.metadata import version
from pathlib import Path
from typing import Any

import yaml
from pydantic import BaseModel, ConfigDict

from agentflow.diversity.topology import tree_hash
from agentflow.env.physics.engine import AUTO
from agentflow.env.physics.engines import choose_engine
from agentflow.env.tasks.records import MACHINES, TaskRecord
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


class MachineRecord(TaskRecord):
    """A record with its machine, as records/<name>.json has it."""

    blocks: tuple[dict[str, int], ...]
    """The machine's construction tree."""
    controls: tuple[dict[str, Any], ...] = ()
    """Its control program, if it brings one."""
    controllers: dict[str, Any] | None = None
    """Its controllers, if it senses."""

    @classmethod
    def build(cls, machine: Machine, **scores: Any) -> MachineRecord:
        """The record of a machine with these scores."""
        return cls(
            size=len(machine),
            tree=tree_hash(machine),
            blocks=tuple(step.to_json() for step in machine),
            controls=tuple(control.to_json() for control in machine.controls),
            controllers=machine.controllers and machine.controllers.to_json(),
            **scores,
        )

    @property
    def machine(self) -> Machine:
        """The machine.

        Raises:
            ValueError: The tree is not one.
        """
        data = {"controllers": self.controllers, "controls": list(self.controls)}
        return _machine({**data, "blocks": list(self.blocks)}, f"the record {self.name}")

    def scores(self) -> dict[str, Any]:
        """What the package knows of it, under its name."""
        return self.model_dump(mode="json", include={*TaskRecord.model_fields} - {"name"})

    def to_text(self) -> str:
        """The content of the file, one block or control per line."""
        own = {"name", "size", "tree", "blocks", "controls"}
        own |= set() if self.controllers else {"controllers"}
        head = self.model_dump(mode="json", exclude=own)
        lines = [f" {json.dumps(key)}: {json.dumps(value)}" for key, value in head.items()]
        for key, items in (("blocks", self.blocks), ("controls", self.controls)):
            rows = ",\n".join("  " + json.dumps(item) for item in items)
            lines += [f' "{key}": [\n{rows}\n ]'] if items else []
        return "{\n" + ",\n".join(lines) + "\n}\n"


def read_record(file: Path) -> MachineRecord:
    """Read a record with its machine."""
    data = json.loads(file.read_text(encoding="utf-8"))
    own = ("blocks", "controls", "controllers")
    scores = {key: value for key, value in data.items() if key not in own}
    return MachineRecord.build(load_file(file), name=file.stem, **scores)


def machine_records(engine: str = "") -> dict[str, MachineRecord]:
    """All records with their machines, or those of another engine, by name of the file."""
    return {file.stem: read_record(file) for file in sorted((MACHINES / engine).glob("*.json"))}


def scores_text(engine: str = "") -> str:
    """What the package has of these records: their scores, one record per line."""
    records = machine_records(engine)
    rows = (f" {json.dumps(n)}: {json.dumps(r.scores())}" for n, r in records.items())
    return "{\n" + ",\n".join(rows) + "\n}\n"


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


def here(engine: str = AUTO) -> str:
    """Platform and package versions; where they are equal, scores are bitwise equal."""
    packages = f"{choose_engine(engine).identity}, numpy {version('numpy')}"
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
    return _machine(path.read_text(encoding="utf-8"), str(path))


def _machine(source: object, name: str) -> Machine:
    reading = read_machine(source, range(1000))
    if reading.machine is None:
        raise ValueError(f"{name}: {reading.problems[0].message}")
    return reading.machine
