"""Directories of evaluations: written, continued after a kill, found in folders and pooled.

evaluation.json   what is evaluated, and under which conditions; the results, once it is finished
samples.jsonl     the judged replies, one a line, task by task
calls.jsonl       every call of the model, unless it is a folder
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ValidationError

from agentflow.errors import RunError
from agentflow.files.documents import Difference, Document, holds
from agentflow.files.faults import locate_fault
from agentflow.files.folders import hold_folder
from agentflow.files.lines import LineFile, open_lines, read_lines
from agentflow.llm.messages import Sampling
from agentflow.models.choices import CALLS
from agentflow.training.evaluation.replies import JudgedReply, Summary, summaries
from agentflow.training.record import ABOUT as TRAINING
from agentflow.training.record import TrainingRecord, read_training

ABOUT, REPLIES = "evaluation.json", "samples.jsonl"


class EvaluationRecord(BaseModel, frozen=True, extra="forbid"):
    """The content of evaluation.json: everything that decides the results, and the results."""

    format: Literal[1] = 1
    name: str
    """Name of the row in tables; evaluations with the same name are pooled."""
    model: str
    """As given: a name at an endpoint, `procedural`, or a folder."""
    files: str | None = None
    """Digest of the model's files; None without a folder, and in older evaluations."""
    label: str
    """The model's name in results."""
    trained_on: tuple[str, ...] = ()
    """Tasks of the reinforcement learning that made the model, where its folder says so."""
    tasks: tuple[str, ...]
    samples: int
    """Replies to each task."""
    seed: int
    """Of the model's random choices, and of the tasks' trials."""
    sampling: Sampling
    prompts: str
    """Prompt set with its digest."""
    knobs: Mapping[str, Any] = {}
    conditions: Annotated[Mapping[str, str], holds("engine")]
    """Constants, blocks and physics engine of the simulations."""
    results: Mapping[str, Mapping[str, Any]] | None = None
    """Task -> its numbers; None until the evaluation is finished."""


class _EvaluationDocument(Document[EvaluationRecord]):
    def differs(self, folder: Path, different: Difference) -> RunError:
        if different.key != "files":
            return super().differs(folder, different)
        return RunError(
            f"the files of {self.read(folder).model} have changed since {folder} was started: "
            "restore them, or choose another folder with --out"
        )


DOCUMENT = _EvaluationDocument(ABOUT, EvaluationRecord, "an evaluation", outcome=("results",))


class EvaluationFolder:
    """The directory of an evaluation, open for writing."""

    def __init__(
        self, path: Path, about: EvaluationRecord, lines: LineFile, replies: list[JudgedReply]
    ) -> None:
        """Use `open_evaluation`."""
        self.path, self.about, self._lines = path, about, lines
        self.replies = replies
        """All that are judged so far, in order."""

    @property
    def missing(self) -> int:
        """Replies that are still to come."""
        return self.about.samples * len(self.about.tasks) - len(self.replies)

    def add(self, replies: list[JudgedReply]) -> None:
        """Save judged replies."""
        for reply in replies:
            self._lines.append(reply.model_dump_json().encode())
        self.replies += replies

    def finish(self) -> EvaluationRecord:
        """Write the results."""
        found = summaries(self.replies, self.about.tasks, self.about.seed)
        results = {task: summary.to_json() for task, summary in found.items()}
        self.about = EvaluationRecord.model_validate(
            {**self.about.model_dump(), "results": results}
        )
        DOCUMENT.write(self.path, self.about)
        return self.about


@contextmanager
def open_evaluation(path: Path, about: EvaluationRecord) -> Iterator[EvaluationFolder]:
    """Begin an evaluation in a new or empty folder, or continue the one that is there.

    One without any reply, such as of a model that could not be reached, is started again.

    Raises:
        RunError: The folder holds something else, or another evaluation; it is damaged, in use by
            another process, or cannot be written.
    """
    with hold_folder(path):
        recorded = DOCUMENT.find(path)
        if recorded and recorded.files is None and recorded.model == about.model:  # an older one
            about = about.model_copy(update={"files": None})
        about = DOCUMENT.begin(path, about, (REPLIES, CALLS))
        parse = JudgedReply.model_validate_json
        with open_lines(path / REPLIES, parse, _damaged) as (lines, replies):
            _require_order(path, about, replies)
            yield EvaluationFolder(path, about, lines, replies)


def read_evaluation(path: Path) -> EvaluationRecord:
    """What an evaluation directory says about itself.

    Raises:
        RunError: It is not an evaluation directory, or evaluation.json is damaged.
    """
    return DOCUMENT.read(path)


def read_replies(path: Path) -> list[JudgedReply]:
    """The judged replies in a file of JSON lines; a half-written last line is left out.

    Raises:
        RunError: The file cannot be read, or a line is damaged.
    """
    return list(read_lines(path, JudgedReply.model_validate_json, _damaged))


def _damaged(file: Path, number: int, why: ValueError) -> RunError:
    assert isinstance(why, ValidationError)
    told = " ".join(locate_fault(why, "it"))
    return RunError(f"{file}, line {number} is damaged: {told}")


def _require_order(path: Path, about: EvaluationRecord, replies: list[JudgedReply]) -> None:
    """Refuse replies that are not to the tasks of an evaluation in their order."""
    expected = [task for task in about.tasks for _ in range(about.samples)]
    found = [reply.task for reply in replies]
    if found != expected[: len(found)]:
        raise RunError(
            f"{path / REPLIES} does not hold the replies of this evaluation in their order: "
            "remove the file to evaluate again"
        )


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
