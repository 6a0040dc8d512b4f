"""Writes the directory of a training run, one process at a time; continues it after a kill."""

from __future__ import annotations

import json
import re
import shutil
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from math import isfinite
from pathlib import Path
from typing import Any

import yaml
from pydantic import BaseModel

from agentflow.app.about import require_empty, write_about
from agentflow.errors import RunError
from agentflow.files import (
    LineFile,
    hold_folder,
    parse_object,
    remove_partial_files,
    whole_lines,
    write_atomically,
)
from agentflow.training.record import (
    ABOUT,
    CONFIG,
    CURVES,
    MODEL,
    RESULT,
    SAMPLES,
    About,
    TrainingRecord,
    read_curves,
    read_result,
    read_row,
    read_training,
    samples_of,
)

CHECKPOINT = re.compile(r"checkpoint-(\d+)")
"""Name of a checkpoint's folder, with its step."""
LIBRARY_STATE = "trainer_state.json"
"""The file that the training library writes last into a checkpoint."""


class TrainingRun:
    """A training directory open for writing, by one process at a time."""

    def __init__(self, path: Path) -> None:
        """Use `open`."""
        self.path = path
        remove_partial_files(path)
        self.checkpoint = _last_checkpoint(path)
        """The last complete checkpoint, from which training continues; None at the start."""
        if self.result is None:
            self._cut(-1 if self.checkpoint is None else _step_of(self.checkpoint))
        rows = read_curves(path)
        self._begun = time.monotonic() - (rows[-1]["seconds"] if rows else 0.0)
        self._curves = LineFile(path / CURVES)

    @classmethod
    @contextmanager
    def open(
        cls, path: Path, about: About, config: BaseModel, resume: bool
    ) -> Iterator[TrainingRun]:
        """Begin a run in a new or empty folder, or continue the one that is there.

        What an interrupted process wrote after its last complete checkpoint is removed, so that
        no step is noted twice.

        Args:
            path: The directory.
            about: What is trained.
            config: The complete configuration.
            resume: Continue the run in `path`, if there is one.

        Raises:
            RunError: The folder holds something else; a run without `resume`; a run with another
                configuration or other files; another process uses it, or it cannot be written.
        """
        with hold_folder(path):
            if (path / ABOUT).exists():
                if not resume:
                    raise RunError(
                        f"{path} holds a training run; continue it with --resume, or name "
                        "another folder with --out"
                    )
                _require_same(read_training(path), about, config)
            else:
                require_empty(path / ABOUT, "a training run", leftovers=[CONFIG])
                document = config.model_dump(mode="json")
                _write(path / CONFIG, yaml.safe_dump(document, sort_keys=False))
                write_about(path / ABOUT, about)
            run = cls(path)
            try:
                yield run
            finally:
                run._curves.close()

    @property
    def model(self) -> Path:
        """Where the final model belongs."""
        return self.path / MODEL

    @property
    def result(self) -> Mapping[str, Any] | None:
        """The result of a finished run; None if it is not finished."""
        return read_result(self.path)

    def note(self, step: int, numbers: Mapping[str, Any]) -> None:
        """Add a line to the curves; infinite and undefined numbers become null."""
        seconds = round(time.monotonic() - self._begun, 3)
        row = {"step": step, "seconds": seconds} | {k: _finite(v) for k, v in numbers.items()}
        self._curves.append(json.dumps(row, allow_nan=False).encode())

    def samples(self, step: int, replies: Iterable[BaseModel]) -> None:
        """Save the judged replies of a step."""
        path = self.path / SAMPLES / f"step-{step:06}.jsonl"
        path.parent.mkdir(exist_ok=True)
        _write(path, "".join(f"{reply.model_dump_json()}\n" for reply in replies))

    def finish(self, result: Mapping[str, Any]) -> dict[str, Any]:
        """Write the result, with the seconds that training took, and return it."""
        complete = {**result, "seconds": round(time.monotonic() - self._begun, 1)}
        _write(self.path / RESULT, json.dumps(complete, indent=1) + "\n")
        return complete

    def _cut(self, step: int) -> None:
        """Remove what was written after a step: lines, samples, incomplete checkpoints."""
        curves = self.path / CURVES
        if curves.exists():
            rows = [
                line for _, line in whole_lines(curves) if read_row(curves, line)["step"] <= step
            ]
            _write(curves, b"".join(line.rstrip(b"\n") + b"\n" for line in rows).decode())
        for number, path in samples_of(self.path).items():
            if number > step:
                path.unlink()
        for path in _checkpoints(self.path):
            if _step_of(path) > step:
                shutil.rmtree(path)


def _require_same(record: TrainingRecord, about: About, config: BaseModel) -> None:
    """Refuse to continue a run with another kind or configuration, or with other files."""
    if record.about.kind != about.kind:
        raise RunError(f"{record.path} is a run of {record.about.kind}, not of {about.kind}")
    ours = config.model_dump(mode="json")
    other = sorted(
        key for key in {*ours, *record.config} if ours.get(key) != record.config.get(key)
    )
    if other:
        raise RunError(
            f"{record.path} was started with another {other[0]}: {record.config.get(other[0])!r}, "
            f"not {ours.get(other[0])!r}; continue it with the configuration in its {CONFIG}, or "
            "name another folder with --out"
        )
    for key, digest in about.inputs.items():
        if record.about.inputs.get(key, digest) != digest:
            raise RunError(
                f"the files of {key} have changed since {record.path} was started: restore them, "
                "or name another folder with --out"
            )


def _checkpoints(path: Path) -> list[Path]:
    return [found for found in path.iterdir() if CHECKPOINT.fullmatch(found.name)]


def _step_of(checkpoint: Path) -> int:
    return int(checkpoint.name.rpartition("-")[2])


def _last_checkpoint(path: Path) -> Path | None:
    """The complete checkpoint with the greatest step; a kill may leave an incomplete one."""
    return max(filter(_is_complete, _checkpoints(path)), key=_step_of, default=None)


def _is_complete(checkpoint: Path) -> bool:
    try:
        state = parse_object((checkpoint / LIBRARY_STATE).read_bytes())
    except OSError:
        return False
    return state is not None and state.get("global_step") == _step_of(checkpoint)


def _write(path: Path, text: str) -> None:
    with write_atomically(path) as part:
        part.write_text(text, encoding="utf-8")


def _finite(value: Any) -> Any:
    return None if isinstance(value, float) and not isfinite(value) else value
