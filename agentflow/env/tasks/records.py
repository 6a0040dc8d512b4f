"""Records: the best known machine of each level, which shows what a score is worth.

Each is a file `records/<name>.json`; `benchmarks/records.py` finds and updates them. Some levels
also have records with changed knobs: those of the benchmark's items.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from functools import cache
from importlib.resources import files
from typing import Any

from pydantic import BaseModel, ConfigDict

from agentflow.env.physics.engine import AUTO
from agentflow.env.physics.engines import default_engine
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.registry import get_task
from agentflow.env.tasks.requirements import RequirementKnobs
from agentflow.holding import Holding
from agentflow.machine.blocks.library import library
from agentflow.machine.formats.parse import read_machine
from agentflow.machine.tree import Machine

FOLDER = "records"


class TaskRecord(BaseModel):
    """The best known machine of a task, by verified score."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    task: str
    """Name of the level."""
    knobs: dict[str, Any] = {}
    """Dotted knobs that differ from the level's."""
    seed: int = 0
    """Random seed of the trials."""
    score: float
    verified: float
    """Median of the scores under small variations of physics; see `env.verification`."""
    low: float
    """Lowest of these scores."""
    of: int = 0
    """How many there are; 0 in a file that `benchmarks/records.py update` has yet to complete."""
    fails: dict[str, float] = {}
    """The scores that do not hold, by variation; see `holding`."""
    how: str
    """How the machine was found."""
    platform: str
    """Platform and package versions; where they are equal, scores are bitwise equal."""
    blocks: tuple[dict[str, int], ...]
    """The machine's construction tree."""
    controls: tuple[dict[str, Any], ...] = ()
    """Its control program, if it brings one."""
    controllers: dict[str, Any] | None = None
    """Its controllers, if it senses."""

    @property
    def engine(self) -> str:
        """Name and version of the physics engine that simulated it, e.g. "pybullet 3.2.7"."""
        return self.platform.split(", ")[1]

    @property
    def holding(self) -> Holding:
        """In which simulations the score holds."""
        return Holding(self.of, tuple(self.fails))

    @property
    def machine(self) -> Machine:
        """The machine.

        Raises:
            ValueError: The tree is not one.
        """
        data = {
            "blocks": list(self.blocks),
            "controls": list(self.controls),
            "controllers": self.controllers,
        }
        reading = read_machine(data, tuple(library()))
        if reading.machine is None:
            raise ValueError(f"the record of {self.task}: {reading.problems[0].message}")
        return reading.machine

    def to_text(self) -> str:
        """The content of the file, one block or control per line."""
        own = {"blocks", "controls", *([] if self.controllers else ["controllers"])}
        head = self.model_dump(mode="json", exclude=own)
        lines = [f" {json.dumps(key)}: {json.dumps(value)}" for key, value in head.items()]
        for key, items in (("blocks", self.blocks), ("controls", self.controls)):
            rows = ",\n".join("  " + json.dumps(item) for item in items)
            lines += [f' "{key}": [\n{rows}\n ]'] if items else []
        return "{\n" + ",\n".join(lines) + "\n}\n"


@cache
def read_records() -> Mapping[str, TaskRecord]:
    """All records by name of their file, without the ending."""
    folder = files(__package__) / FOLDER
    found = sorted((item for item in folder.iterdir()), key=lambda item: item.name)
    return {
        item.name.removesuffix(".json"): TaskRecord.model_validate_json(item.read_bytes())
        for item in found
        if item.name.endswith(".json")
    }


def other_recorders(engines: Iterable[str]) -> str:
    """The engines that simulated the records, if one of `engines` is none of them; else "".

    Versions of one engine count as the same.
    """
    recorders = sorted({record.engine for record in read_records().values()})
    names = {engine.partition(" ")[0] for engine in recorders}
    same = all(engine.partition(" ")[0] in names for engine in engines)
    return "" if same else " and ".join(recorders)


def record_of(task: Task) -> TaskRecord | None:
    """The record of a task; None if there is none for this level with these knobs."""
    return next((item for item in read_records().values() if _fits(item, task)), None)


def full_score(task: Task, lowest: bool = False) -> float | None:
    """The score that a share of 1 stands for: the greatest possible one, or that of the record.

    Args:
        task: The task.
        lowest: Take the lowest score of the record's verification in place of the median.

    Returns:
        None if there is neither, or if it is not above 0.
    """
    if task.brief.greatest is not None:
        return task.brief.greatest
    found = record_of(task)
    return (found.low if lowest else found.verified) or None if found else None


def record_json(task: Task, score: float | None = None) -> dict[str, Any] | None:
    """The record of a task for readers; None if there is none.

    Returns:
        `score`, `verified`, `fragile`, `engine`, `how`, `blocks` (how many count), and the share
        that `score` reaches as `share` and `of`: "record", with the name of its engine if that of
        the task is another one, or "greatest possible score".
    """
    found = record_of(task)
    if found is None:
        return None
    return {
        "score": found.score,
        "verified": found.verified,
        "fragile": found.holding.fragile,
        "engine": found.engine,
        "how": found.how,
        "blocks": task.brief.count_blocks(len(found.blocks)),
        "share": record_share(task, score),
        "of": _full_name(task, found),
    }


def _full_name(task: Task, record: TaskRecord) -> str:
    """What a share of 1 stands for."""
    if task.brief.greatest is not None:
        return "greatest possible score"
    name = default_engine().name if task.engine == AUTO else task.engine
    same = record.engine.rpartition(" ")[0] == name
    return "record" if same else f"record of {record.engine}"


def record_share(task: Task, score: float | None) -> float | None:
    """The share of the full score that a score on a task reaches; None without either."""
    full = full_score(task)
    return None if score is None or full is None else score / full


def _fits(record: TaskRecord, task: Task) -> bool:
    """Whether a record is for the task: knobs are compared by value, not as written."""
    if record.task != task.name:
        return False
    knobs: Any = task.parameters
    if knobs.requirements.mode == "report":  # they change no score
        knobs = knobs.model_copy(update={"requirements": RequirementKnobs()})
    return bool(get_task(record.task, record.knobs).parameters == knobs)
