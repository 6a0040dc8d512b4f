"""Finds the evaluations and training runs in folders, and pools evaluations of the same name."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from agentflow.errors import RunError
from agentflow.training.evaluation.record import (
    ABOUT,
    REPLIES,
    EvaluationRecord,
    read_evaluation,
    read_replies,
)
from agentflow.training.evaluation.replies import JudgedReply, Summary, summaries
from agentflow.training.record import ABOUT as TRAINING
from agentflow.training.record import TrainingRecord, read_training

SAME = ("label", "trained_on", "sampling", "prompts", "knobs", "conditions")
"""What must be the same in evaluations that are pooled, such as of models from several seeds."""


@dataclass(frozen=True)
class PooledEvaluation:
    """Evaluations of the same name as one: their replies count alike."""

    name: str
    members: Mapping[Path, EvaluationRecord]
    replies: tuple[JudgedReply, ...]

    @property
    def first(self) -> EvaluationRecord:
        """One of them, for what they have in common."""
        return next(iter(self.members.values()))

    @property
    def tasks(self) -> tuple[str, ...]:
        """Every task of any of them, in order."""
        return tuple(
            dict.fromkeys(task for member in self.members.values() for task in member.tasks)
        )

    @property
    def missing(self) -> int:
        """Replies that are still to come."""
        planned = sum(member.samples * len(member.tasks) for member in self.members.values())
        return planned - len(self.replies)

    @cached_property
    def summaries(self) -> dict[str, Summary]:
        """Task -> its numbers."""
        return summaries(self.replies, self.tasks)


@dataclass(frozen=True)
class Collection:
    """What folders hold."""

    evaluations: tuple[PooledEvaluation, ...]
    trainings: Mapping[str, TrainingRecord]
    """Name -> training run."""

    @property
    def tasks(self) -> tuple[str, ...]:
        """Tasks of all evaluations, in order."""
        return tuple(dict.fromkeys(task for found in self.evaluations for task in found.tasks))

    @property
    def engines(self) -> tuple[str, ...]:
        """The physics engines of the evaluations."""
        return tuple(dict.fromkeys(found.first.conditions["engine"] for found in self.evaluations))


def collect(folders: Sequence[Path]) -> Collection:
    """Read the evaluations and training runs in folders, by path; the folders in their order.

    Raises:
        RunError: One holds none, or a damaged one; or evaluations of the same name cannot be
            pooled.
    """
    evaluations: dict[Path, EvaluationRecord] = {}
    trainings: dict[str, TrainingRecord] = {}
    for folder in folders:
        found = [path.parent for path in _files(folder, ABOUT)]
        runs = [path.parent for path in _files(folder, TRAINING)]
        if not found and not runs:
            raise RunError(
                f"{folder} is not a sweep directory: it has no readable sweep.yaml, and it holds "
                f"no evaluations ({ABOUT}) and no training runs ({TRAINING})"
            )
        evaluations |= {path: read_evaluation(path) for path in found}
        trainings |= {_name_of(path, folder, folders): read_training(path) for path in runs}
    return Collection(tuple(_pool(evaluations)), trainings)


def _name_of(path: Path, folder: Path, folders: Sequence[Path]) -> str:
    """The name of a training run: its path, without that of the folder if there is only one."""
    if len(folders) > 1:
        return str(path)
    return path.resolve().name if path == folder else str(path.relative_to(folder))


def _files(folder: Path, name: str) -> list[Path]:
    return sorted(path for path in folder.rglob(name) if path.is_file())


def _pool(evaluations: Mapping[Path, EvaluationRecord]) -> Iterable[PooledEvaluation]:
    for name in dict.fromkeys(about.name for about in evaluations.values()):
        members = {path: about for path, about in evaluations.items() if about.name == name}
        _require_poolable(members)
        replies = [
            reply
            for path in members
            if (path / REPLIES).exists()
            for reply in read_replies(path / REPLIES)
        ]
        yield PooledEvaluation(name, members, tuple(replies))


def _require_poolable(members: Mapping[Path, EvaluationRecord]) -> None:
    """Refuse to pool replies that were sampled or judged in different ways, or twice."""
    (first, about), *others = members.items()
    for path, other in others:
        different = [key for key in SAME if getattr(about, key) != getattr(other, key)]
        if different:
            raise RunError(
                f"{first} and {path} are both named {about.name!r} but have another "
                f"{different[0]}, so they cannot be pooled: evaluate one of them again with "
                "another --name"
            )
    seen: dict[str, Path] = {}
    for path, other in members.items():
        known = seen.setdefault(f"{other.model} {other.seed}", path)
        if known != path and set(members[known].tasks) & set(other.tasks):
            raise RunError(
                f"{known} and {path} are the same evaluation, with the same model and seed: name "
                "only one of them"
            )
