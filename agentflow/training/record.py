"""Reads the directory of a training run: configuration, curves, samples, result.

training.json       what kind of training, the label of its model, digests of what it reads
config.yaml         the complete configuration
curves.jsonl        one line for each logged step
samples/            step-000040.jsonl: the judged replies of a step, one a line
checkpoint-40/      written by the training library
model/              the final model
result.json         written last: only finished runs have it
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, ValidationError

from agentflow.config.run import explain
from agentflow.config.yaml import NOT_YAML, read_yaml
from agentflow.errors import RunError
from agentflow.files import parse_object, whole_lines

ABOUT, CONFIG, CURVES, RESULT = "training.json", "config.yaml", "curves.jsonl", "result.json"
SAMPLES, MODEL = "samples", "model"

Kind = Literal["sft", "grpo"]


class About(BaseModel):
    """The content of training.json."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: Kind
    label: str
    """Name of the trained model in results."""
    inputs: Mapping[str, str] = {}
    """Key of the configuration that names files -> digest of them; none in older directories."""
    format: Literal[1] = 1
    """Version of the directory's layout."""


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
    try:
        about = About.model_validate(parse_object((path / ABOUT).read_bytes()) or {})
        config = read_yaml((path / CONFIG).read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        missing = Path(str(error.filename)).name
        raise RunError(f"{path} is not a training run: it has no {missing}") from None
    except OSError as error:
        raise RunError(f"cannot read {path}: {error.strerror}") from None
    except ValidationError as error:
        raise RunError(f"{path / ABOUT}: {explain(error, About, 'key')}") from None
    except NOT_YAML as error:
        raise RunError(f"{path / CONFIG} is damaged: {error}") from None
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
    curves, rows = path / CURVES, dict[int, dict[str, Any]]()
    if curves.exists():
        for _, line in whole_lines(curves):
            row = read_row(curves, line)
            rows[row["step"]] = rows.get(row["step"], {}) | row
    return tuple(rows[step] for step in sorted(rows))


def read_row(curves: Path, line: bytes) -> dict[str, Any]:
    """A line of the curves; RunError if it is none."""
    row = parse_object(line)
    if row is None or not isinstance(row.get("step"), int):
        raise RunError(f"{curves} is damaged: {line[:60]!r} is not an object with a step")
    return row


def read_result(path: Path) -> dict[str, Any] | None:
    """The result of a finished run; None if it is not finished."""
    if not (path / RESULT).exists():
        return None
    result = parse_object((path / RESULT).read_bytes())
    if result is None:
        raise RunError(f"{path / RESULT} is damaged: it is not a JSON object")
    return result
