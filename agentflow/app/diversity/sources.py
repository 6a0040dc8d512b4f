"""Finds the machines of runs, sweeps, training runs and folders of machine files."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from pydantic import ValidationError

from agentflow.app.machines.files import read_one
from agentflow.errors import RunError, UsageError
from agentflow.files.atomic import os_errors
from agentflow.files.lines import read_lines
from agentflow.machine import Machine, library, place, read_machine, spatial_problems
from agentflow.metrics.machines import recorded_machine
from agentflow.runs import find_runs, read_document
from agentflow.runs.events import read_typed_events
from agentflow.runs.record import RunRecord
from agentflow.training.evaluation.replies import JudgedReply
from agentflow.training.record import ABOUT, read_training

SUFFIXES = (".json", ".bsg")
"""Machine files."""


@dataclass(frozen=True)
class Source:
    """A set of machines, and what it is called."""

    name: str
    machines: tuple[Machine, ...]
    left_out: Mapping[str, str] = field(default_factory=dict)
    """File that is not a construction tree -> why."""


def read_sources(path: Path, valid: bool) -> list[Source]:
    """The machines in a directory; those of a training run by step.

    Args:
        path: A run (the machines at the end of its last stage, one per trajectory), a directory
            that holds runs, such as a sweep (those of all runs), a training run (those in the
            replies of each sampled step), or a folder with machine files.
        valid: Leave out invalid machines. Those of runs and of training were judged by the rules of
            their task, those in files are judged by the rules of space.

    Raises:
        RunError: It is none of these, or is damaged.
    """
    if (path / ABOUT).is_file():
        files = read_training(path).samples.items()
        return [Source(f"{path}, step {n}", tuple(_replies(file, valid))) for n, file in files]
    if runs := list(find_runs(path)):
        return [Source(str(path), tuple(m for run in runs for m in _candidates(run, valid)))]
    return [_folder(path, valid)]


def _candidates(run: Path, valid: bool) -> Iterator[Machine]:
    read_document(run)  # refuses edited runs and links
    found = RunRecord.of(read_typed_events(run)).candidates
    for item in found:
        if item.location.name != found[-1].location.name or item.machine is None:
            continue
        if item.valid or not valid:
            yield recorded_machine(run, item.machine)


def _replies(file: Path, valid: bool) -> Iterator[Machine]:
    for reply in read_lines(file, _read_reply):
        machine = read_machine(reply.machine, tuple(library())).machine if reply.machine else None
        if machine is not None and (reply.valid or not valid):
            yield machine


def _read_reply(line: bytes) -> JudgedReply:
    try:
        return JudgedReply.model_validate_json(line)
    except ValidationError:
        raise ValueError("expected a judged reply") from None


def _folder(path: Path, valid: bool) -> Source:
    files = [file for file in _entries(path) if file.suffix.lower() in SUFFIXES]
    if not files:
        raise RunError(
            f"{path} holds no machines: expected a run, a sweep, a training run, or .json or .bsg "
            "files"
        )
    machines, left_out = [], {}
    for file in files:
        try:
            machines.append(read_one(str(file)))
        except UsageError as error:
            left_out[file.name] = str(error).removeprefix(f"{file}").lstrip(": ")
    kept = (m for m in machines if not valid or not spatial_problems(place(m)))
    return Source(str(path), tuple(kept), left_out)


def _entries(path: Path) -> list[Path]:
    with os_errors(f"cannot read {path}"):
        return sorted(entry for entry in path.iterdir() if entry.is_file())
