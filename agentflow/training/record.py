"""The directory of a training run: written by one process at a time, continued after a kill.

training.json       what kind of training, the label of its model, digests of what it reads
config.yaml         the complete configuration
curves.jsonl        one line for each logged step
samples/            step-000040.jsonl: the judged replies of a step, one a line
checkpoint-40/      written by the training library
model/              the final model
result.json         written last: only finished runs have it
"""

from __future__ import annotations

import hashlib
import json
import re
import shutil
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any, Literal

import yaml
from pydantic import BaseModel

from agentflow.errors import RunError
from agentflow.files.atomic import remove_partial_files, write_text
from agentflow.files.documents import Document, first_difference, read_object, read_part
from agentflow.files.folders import hold_folder
from agentflow.files.lines import LineFile, parse_object, read_lines
from agentflow.files.yaml import NOT_YAML, read_yaml, yaml_problem
from agentflow.models.local.folder import MODEL, find_model
from agentflow.training.config import TrainingConfig
from agentflow.training.data.pairs import DEV, TRAIN

PART = 1 << 20
"""Bytes that are read at a time."""
MOST_PARTS = 64
"""Parts of a model's file that count. Files of up to 64 MiB count as a whole, larger ones by parts
spread over them: 28 GB take less than a second, and training changes all weights."""


def digest_set(folder: Path) -> str:
    """Digest of the pairs of a set, whole."""
    return _digest_files(file for file in (folder / TRAIN, folder / DEV) if file.is_file())


def digest_model(folder: Path) -> str:
    """Digest of the files of a model: configuration, tokenizer, weights.

    For an adapter, those of the model that it belongs to do not count.

    Raises:
        ConfigError: The folder holds no model.
    """
    files = (path for path in find_model(folder).iterdir() if not path.name.startswith("."))
    return _digest_files((path for path in files if path.is_file()), MOST_PARTS)


def digest_base(config: TrainingConfig) -> dict[str, str]:
    """Key of the model to begin with -> its digest; nothing if it is not in a folder."""
    folder = Path(config.model.name or "")
    return {"model.name": digest_model(folder)} if config.model.name and folder.is_dir() else {}


def _digest_files(files: Iterable[Path], most: int | None = None) -> str:
    """Digest of names, sizes and content, of which at most so many parts of each file count."""
    digest = hashlib.sha256()
    for file in sorted(files):
        size = file.stat().st_size
        digest.update(f"{file.name} {size}\n".encode())
        with file.open("rb") as content:
            for start in range(0, size, max(PART, size // most if most else 0)):
                content.seek(start)
                digest.update(content.read(PART))
    return digest.hexdigest()[:16]


OF_SAMPLES = "eval."
"""Before the names of numbers of the samples taken between steps: eval.TASK.NAME."""
MOST = 1e300
"""Largest number that counts."""


def flatten(row: Mapping[str, Any], above: str = "") -> dict[str, float]:
    """The numbers of a logged step and of the groups in it: `eval.throwing.mean`.

    Texts, lists, and values that are missing, infinite or undefined are left out.
    """
    found: dict[str, float] = {}
    for key, value in row.items():
        if isinstance(value, Mapping):
            found |= flatten(value, f"{above}{key}.")
        elif type(value) in (int, float) and -MOST <= value <= MOST:  # not so of NaN
            found[f"{above}{key}"] = value
    return found


ABOUT, CONFIG, CURVES, RESULT = "training.json", "config.yaml", "curves.jsonl", "result.json"
SAMPLES = "samples"

Kind = Literal["sft", "grpo"]


class About(BaseModel, frozen=True, extra="forbid"):
    """The content of training.json."""

    kind: Kind
    label: str
    """Name of the trained model in results."""
    inputs: Mapping[str, str] = {}
    """Key of the configuration that names files -> digest of them; none in older directories."""
    format: Literal[1] = 1


DOCUMENT = Document(ABOUT, About, "a training run")


@dataclass(frozen=True)
class TrainingRecord:
    """What a training directory says, of a finished run or of one in progress."""

    path: Path
    about: About
    config: Mapping[str, Any]
    curves: tuple[Mapping[str, Any], ...]
    """For each logged step, in order: `step`, `seconds` of training so far, and its numbers."""
    samples: Mapping[int, Path]
    """Step -> file with its judged replies."""
    result: Mapping[str, Any] | None
    """None until the run has finished."""

    @property
    def model(self) -> Path:
        """Where the final model is, or will be."""
        return self.path / MODEL


def read_training(path: Path) -> TrainingRecord:
    """Read a training directory; runs in progress may be read as well.

    Raises:
        RunError: It is not a training directory, or a file of it is damaged.
    """
    about = DOCUMENT.read(path)
    try:
        config = read_yaml(read_part(path / CONFIG, DOCUMENT.what).decode())
    except NOT_YAML as error:
        raise RunError(f"{path / CONFIG} is damaged: {yaml_problem(error)}") from None
    if not isinstance(config, dict):
        raise RunError(f"{path / CONFIG} is damaged: expected a mapping of keys")
    return TrainingRecord(
        path, about, config, read_curves(path), samples_of(path), read_result(path)
    )


def samples_of(path: Path) -> dict[int, Path]:
    """Step -> file with its judged replies."""
    files = sorted((path / SAMPLES).glob("step-*.jsonl"))
    return {int(found[1]): p for p in files if (found := re.fullmatch(r"step-(\d+)", p.stem))}


def read_curves(path: Path) -> tuple[dict[str, Any], ...]:
    """The numbers of each step; several lines of one step are joined."""
    rows = dict[int, dict[str, Any]]()
    for row in read_lines(path / CURVES, read_row):
        rows[row["step"]] = rows.get(row["step"], {}) | row
    return tuple(rows[step] for step in sorted(rows))


def read_row(line: bytes) -> dict[str, Any]:
    """A line of the curves; ValueError if it is none."""
    row = parse_object(line)
    if row is None or not isinstance(row.get("step"), int):
        raise ValueError(f"{line[:60]!r} is not an object with a step and finite numbers")
    return row


def read_result(path: Path) -> dict[str, Any] | None:
    """The result of a finished run; None if it is not finished."""
    return read_object(path / RESULT) if (path / RESULT).exists() else None


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
            if DOCUMENT.find(path, leftovers=[CONFIG]):
                if not resume:
                    raise RunError(
                        f"{path} holds a training run; continue it with --resume, or name "
                        "another folder with --out"
                    )
                _require_same(read_training(path), about, config)
            else:
                document = config.model_dump(mode="json")
                write_text(path / CONFIG, yaml.safe_dump(document, sort_keys=False))
                DOCUMENT.write(path, about)
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
        row = {"step": step, "seconds": seconds} | {
            name: None if isinstance(value, float) and not isfinite(value) else value
            for name, value in numbers.items()
        }
        self._curves.append(json.dumps(row, allow_nan=False).encode())

    def samples(self, step: int, replies: Iterable[BaseModel]) -> None:
        """Save the judged replies of a step."""
        path = self.path / SAMPLES / f"step-{step:06}.jsonl"
        path.parent.mkdir(exist_ok=True)
        write_text(path, "".join(f"{reply.model_dump_json()}\n" for reply in replies))

    def finish(self, result: Mapping[str, Any]) -> dict[str, Any]:
        """Write the result, with the seconds that training took, and return it."""
        complete = {**result, "seconds": round(time.monotonic() - self._begun, 1)}
        write_text(self.path / RESULT, json.dumps(complete, indent=1) + "\n")
        return complete

    def _cut(self, step: int) -> None:
        """Remove what was written after a step: lines, samples, incomplete checkpoints."""
        curves = self.path / CURVES
        if curves.exists():
            rows = read_lines(curves, lambda line: (read_row(line)["step"], line.decode()))
            kept = [line.rstrip("\n") + "\n" for number, line in rows if number <= step]
            write_text(curves, "".join(kept))
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
    if other := first_difference(record.config, config.model_dump(mode="json")):
        raise RunError(
            f"{record.path} was started with another {other.key}: {other.before!r}, not "
            f"{other.now!r}; continue it with the configuration in its {CONFIG}, or name another "
            "folder with --out"
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
        state = json.loads((checkpoint / LIBRARY_STATE).read_bytes())  # may hold a loss of NaN
    except (OSError, ValueError, RecursionError):
        return False
    return isinstance(state, dict) and state.get("global_step") == _step_of(checkpoint)
