"""Records: the best known score of each level, which shows what a score is worth.

Their machines solve what models are measured with, so the package has none of them: they are in the
folder `records` of the repository. `benchmarks/records.py` finds machines and writes `records.json`
from them. Some levels also have records with changed knobs. Other engines than that of these have
their own, in a folder and a file with their name.
"""

import json
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict

from agentflow.env.physics.engine import AUTO
from agentflow.env.physics.engines import default_engine
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.knobs import RequirementKnobs
from agentflow.env.tasks.registry import get_task
from agentflow.holding import Holding
from agentflow.machine.blocks.library import library
from agentflow.machine.formats.parse import read_machine
from agentflow.machine.tree import Machine

SCORES = Path(__file__).with_suffix(".json")
"""What the package knows of all records, by name."""
MACHINES = Path(__file__).parents[3] / "records"
"""The folder of the repository with the machine of each record, as `<name>.json`."""


class TaskRecord(BaseModel):
    """What the best known machine of a task (a level) reaches, by verified score, and how it was
    found."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str
    """Path of its machine in the folder of records, without suffix."""
    task: str
    knobs: dict[str, Any] = {}
    """Dotted knobs that differ from the level's."""
    seed: int = 0
    score: float
    verified: float
    """Median of the scores under small variations of physics; see `env.verification`."""
    low: float
    of: int = 0
    """How many there are; 0 in a file that `benchmarks/records.py update` has yet to complete."""
    fails: dict[str, float] = {}
    """The scores that do not hold, by variation; see `holding`."""
    how: str
    platform: str
    """Platform and package versions; where they are equal, scores are bitwise equal."""
    size: int
    """Number of blocks of the machine, with its root."""
    tree: str
    """Hash of its tree of block types; see `diversity.topology.tree_hash`."""

    @property
    def engine(self) -> str:
        """Name and version of the physics engine that simulated it, e.g. "pybullet 3.2.7"."""
        return self.platform.split(", ")[1]

    @property
    def holding(self) -> Holding:
        """In which simulations the score holds."""
        return Holding(self.of, tuple(self.fails))


def record_machine(name: str) -> Machine | None:
    """The machine of a record; None where the repository is not at hand."""
    file = MACHINES / f"{name}.json"
    if not file.is_file():
        return None
    return read_machine(file.read_text(encoding="utf-8"), tuple(library())).machine


def scores_file(engine: str = "") -> Path:
    """The file with what the package knows of all records, or of those of another engine."""
    return SCORES.with_stem(f"{SCORES.stem}-{engine}") if engine else SCORES


@cache
def read_records(engine: str = "") -> Mapping[str, TaskRecord]:
    """All records by name, or those of another engine, if it has its own."""
    if not (file := scores_file(engine)).is_file():
        return {}
    found = json.loads(file.read_bytes())
    where = f"{engine}/" if engine else ""
    return {name: TaskRecord(name=where + name, **record) for name, record in found.items()}


def other_recorders(engines: Iterable[str]) -> str:
    """The engines that simulated the records of the default engine, if one of `engines` is none of
    them; else "".

    Versions of one engine count as the same.
    """
    records = read_records(default_engine().name) or read_records()
    recorders = sorted({record.engine for record in records.values()})
    names = {engine.partition(" ")[0] for engine in recorders}
    same = all(engine.partition(" ")[0] in names for engine in engines)
    return "" if same else " and ".join(recorders)


def record_of(task: Task) -> TaskRecord | None:
    """The record of a task on its engine, else on another one; None if there is none for this level
    with these knobs."""
    known = (*read_records(_engine_of(task)).values(), *read_records().values())
    return next((item for item in known if _fits(item, task)), None)


def _engine_of(task: Task) -> str:
    return default_engine().name if task.engine == AUTO else task.engine


def full_score(task: Task) -> float | None:
    """The score that a share of 1 stands for: the greatest possible one, or that of the record;
    None if there is neither, or if it is not above 0."""
    if task.brief.greatest is not None:
        return task.brief.greatest
    found = record_of(task)
    return found.verified or None if found else None


def record_json(task: Task, score: float | None = None) -> dict[str, Any] | None:
    """The record of a task for readers; None if there is none.

    Returns:
        `score`, `verified`, `fragile`, `engine`, `how`, `blocks` (how many count), and the share
        that `score` reaches as `share`, `full` (the score that it is a share of) and `of`:
        "record", with the name of its engine if that of the task is another one, or "greatest
        possible score". Not where its machine is: those who design read this.
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
        "blocks": task.brief.count_blocks(found.size),
        "share": record_share(task, score),
        "full": full_score(task),
        "of": _full_name(task, found),
    }


def _full_name(task: Task, record: TaskRecord) -> str:
    """What a share of 1 stands for."""
    if task.brief.greatest is not None:
        return "greatest possible score"
    same = record.engine.rpartition(" ")[0] == _engine_of(task)
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
