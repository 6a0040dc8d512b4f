"""The directory of an evaluation: written by one process at a time, continued after a kill.

evaluation.json   what is evaluated, and under which conditions; the results, once it is finished
samples.jsonl     the judged replies, one a line, task by task
calls.jsonl       every call of the model, unless it is a folder
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from itertools import groupby
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ValidationError

from agentflow.app.about import read_about, require_empty, require_same, write_about
from agentflow.config.yaml import describe_fault, first_fault
from agentflow.errors import RunError
from agentflow.files import (
    LineFile,
    hold_folder,
    remove_partial_files,
    whole_lines,
)
from agentflow.llm.messages import Sampling
from agentflow.training.evaluation.replies import JudgedReply
from agentflow.training.evaluation.summary import Summary, summarise

ABOUT, REPLIES, CALLS = "evaluation.json", "samples.jsonl", "calls.jsonl"
WHAT = "an evaluation"


class Evaluation(BaseModel, frozen=True, extra="forbid"):
    """The content of evaluation.json: everything that decides the results, and the results."""

    format: Literal[1] = 1
    """Version of the directory's layout."""
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
    conditions: Mapping[str, str]
    """Constants, blocks and physics engine of the simulations."""
    results: Mapping[str, Mapping[str, Any]] | None = None
    """Task -> its numbers; None until the evaluation is finished."""


class EvaluationFolder:
    """The directory of an evaluation, open for writing."""

    def __init__(self, path: Path, about: Evaluation) -> None:
        """Use `open_evaluation`."""
        self.path, self.about = path, about
        self.replies = _expected_replies(path, about)
        """All that are judged so far, in order."""
        self._lines = LineFile(path / REPLIES)  # drops a half-written last line

    @property
    def missing(self) -> int:
        """Replies that are still to come."""
        return self.about.samples * len(self.about.tasks) - len(self.replies)

    def add(self, replies: list[JudgedReply]) -> None:
        """Save judged replies."""
        for reply in replies:
            self._lines.append(reply.model_dump_json().encode())
        self.replies += replies

    def finish(self) -> Evaluation:
        """Write the results."""
        found = summaries(self.replies, self.about.seed)
        results = {task: summary.to_json() for task, summary in found.items()}
        self.about = Evaluation.model_validate({**self.about.model_dump(), "results": results})
        write_about(self.path / ABOUT, self.about)
        return self.about

    def close(self) -> None:
        """Close the file of replies."""
        self._lines.close()


@contextmanager
def open_evaluation(path: Path, about: Evaluation) -> Iterator[EvaluationFolder]:
    """Begin an evaluation in a new or empty folder, or continue the one that is there.

    One without any reply, such as of a model that could not be reached, is begun again.

    Raises:
        RunError: The folder holds something else, or another evaluation; it is damaged, in use by
            another process, or cannot be written.
    """
    with hold_folder(path):
        remove_partial_files(path)
        if (path / ABOUT).exists():
            about = _continue(path, read_evaluation(path), about)
        else:
            require_empty(path / ABOUT, WHAT)
            write_about(path / ABOUT, about)
        folder = EvaluationFolder(path, about)
        try:
            yield folder
        finally:
            folder.close()


def read_evaluation(path: Path) -> Evaluation:
    """What an evaluation directory says about itself.

    Raises:
        RunError: It is not an evaluation directory, or evaluation.json is damaged.
    """
    return read_about(path / ABOUT, Evaluation, WHAT)


def read_replies(path: Path) -> list[JudgedReply]:
    """The judged replies in a file of JSON lines; a half-written last line is left out.

    Raises:
        RunError: The file cannot be read, or a line is damaged.
    """
    try:
        lines = list(whole_lines(path))
    except OSError as error:
        raise RunError(f"cannot read {path}: {error.strerror}") from None
    return [_read_reply(path, number, line) for number, line in lines]


def _read_reply(path: Path, number: int, line: bytes) -> JudgedReply:
    try:
        return JudgedReply.model_validate_json(line)
    except ValidationError as error:
        fault = first_fault(error)
        place = ".".join(map(str, fault["loc"])) or "it"
        why = describe_fault(fault)
        raise RunError(f"{path}, line {number} is damaged: {place} {why}") from None


def summaries(replies: list[JudgedReply], seed: int = 0) -> dict[str, Summary]:
    """Task -> the numbers of its replies, which follow one another."""
    groups = groupby(replies, lambda reply: reply.task)
    return {task: summarise(found, seed) for task, found in groups}


def _expected_replies(path: Path, about: Evaluation) -> list[JudgedReply]:
    """The judged replies of an evaluation, which must be to its tasks in their order."""
    replies = read_replies(path / REPLIES) if (path / REPLIES).exists() else []
    expected = [task for task in about.tasks for _ in range(about.samples)]
    found = [reply.task for reply in replies]
    if found != expected[: len(found)]:
        raise RunError(
            f"{path / REPLIES} does not hold the replies of this evaluation in their order: "
            "remove the file to evaluate again"
        )
    return replies


def _continue(path: Path, recorded: Evaluation, about: Evaluation) -> Evaluation:
    """The recorded evaluation, which must be the same; a new one if that has no replies."""
    before, now = (item.model_dump(mode="json", exclude={"results"}) for item in (recorded, about))
    if before["files"] is None:  # an older evaluation, or a model that is not in a folder
        now["files"] = None
    if before == now:
        return recorded
    if any((path / name).exists() and (path / name).stat().st_size for name in (REPLIES, CALLS)):
        if {**before, "files": now["files"]} == now:
            raise RunError(
                f"the files of {about.model} have changed since {path} was started: restore them, "
                "or choose another folder with --out"
            )
        require_same(path, WHAT, before, now)
    write_about(path / ABOUT, about)
    return about
