"""Whatever agentflow writes, by its path."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from agentflow.app.benchmark.card import Scorecard, read_card
from agentflow.app.sweeps.folder import is_sweep
from agentflow.errors import RunError
from agentflow.notebook.recorded import Run, Sweep, frame
from agentflow.runs import find_runs
from agentflow.runs.reading import FILE_NAME
from agentflow.training.evaluation.record import (
    ABOUT,
    REPLIES,
    EvaluationRecord,
    read_evaluation,
    read_replies,
)
from agentflow.training.evaluation.replies import JudgedReply
from agentflow.training.record import ABOUT as TRAINING
from agentflow.training.record import TrainingRecord, flatten, read_training

if TYPE_CHECKING:
    import pandas


@dataclass(frozen=True, repr=False)
class Evaluation:
    """An evaluation of a model, as `agentflow evaluate` writes it, finished or not."""

    path: Path
    """The evaluation directory."""
    about: EvaluationRecord
    """What is evaluated, under which conditions, and the results of each task once finished."""

    def __repr__(self) -> str:
        return (
            f"Evaluation({str(self.path)!r}, {self.about.label} on {len(self.about.tasks)} tasks)"
        )

    @cached_property
    def replies(self) -> Sequence[JudgedReply]:
        """The judged replies so far, task by task."""
        file = self.path / REPLIES
        return read_replies(file) if file.exists() else ()

    def rows(self) -> list[dict[str, Any]]:
        """The content of `to_frame`, which needs no pandas: one row per reply."""
        return [reply.model_dump(exclude={"machine"}) for reply in self.replies]

    def to_frame(self) -> pandas.DataFrame:
        """One row per reply: task, seed, text, parsed, spatial, valid, status, problem, score.

        Raises:
            ConfigError: pandas is not installed.
        """
        return frame(self.rows(), [name for name in JudgedReply.model_fields if name != "machine"])


@dataclass(frozen=True, repr=False)
class Training:
    """A training run, finished or not."""

    path: Path
    """The training directory."""
    record: TrainingRecord
    """Its kind, configuration, curves, samples, and result once finished."""

    def __repr__(self) -> str:
        steps = self.record.curves[-1]["step"] if self.record.curves else 0
        return f"Training({str(self.path)!r}, {self.record.about.kind}, {steps} steps)"

    def rows(self) -> list[dict[str, float]]:
        """The content of `to_frame`, which needs no pandas: one row per logged step."""
        return [flatten(row) for row in self.record.curves]

    def to_frame(self) -> pandas.DataFrame:
        """One row per logged step: `step`, `seconds` of training so far, and its numbers.

        Raises:
            ConfigError: pandas is not installed.
        """
        return frame(self.rows(), ("step", "seconds"))


@dataclass(frozen=True, repr=False)
class Card:
    """A scorecard of `agentflow benchmark`."""

    path: Path
    """Its file."""
    content: Scorecard
    """Shares of each item and family, conditions, cost."""

    def __repr__(self) -> str:
        share = self.content.total[self.content.ranked].mean
        known = "incomplete" if share is None else f"{share:.3f}"
        return f"Card({str(self.path)!r}, {self.content.model}, {known})"

    def rows(self) -> list[Mapping[str, Any]]:
        """The content of `to_frame`, which needs no pandas: one row per item."""
        return [
            {
                **{key: getattr(item, key) for key in ("item", "family", "task", "full")},
                **{part: item.share(part) for part in item.parts},
                **{key: getattr(best, key) for key in ("score", "fragile", "outcome")},
            }
            for item in self.content.items
            for best in item.parts[self.content.ranked][:1]
        ]

    def to_frame(self) -> pandas.DataFrame:
        """One row per item: item, family, task, full (score of a share of 1), the share in each
        part, and score, fragile, outcome of the best machine of the part that ranks.

        Raises:
            ConfigError: pandas is not installed.
        """
        return frame(self.rows())


Loaded = Run | Sweep | Evaluation | Training | Card
"""What `load` gives."""


def load(path: Path | str) -> Loaded:
    """What agentflow has written to a path: a run, sweep, evaluation, training run or scorecard.

    Where you know which, `Run(path)` and `Sweep(path)` say so to type checkers.

    Args:
        path: Directory of a run, sweep, evaluation or training run, or the file of a scorecard. A
            run that still grows gives what it holds now.

    Raises:
        RunError: The path holds none of these, or it is damaged.
    """
    place = Path(path)
    if not place.exists():
        raise RunError(f"no such file or directory: {place}")
    if place.is_file():
        return Card(place, read_card(place))
    if (place / FILE_NAME).exists():
        return Run(place)
    if is_sweep(place):
        return Sweep(place)
    if (place / ABOUT).exists():
        return Evaluation(place, read_evaluation(place))
    if (place / TRAINING).exists():
        return Training(place, read_training(place))
    what = "is not a run, sweep, evaluation or training run"
    if next(find_runs(place), None) is not None:
        raise RunError(f"{place} {what}, but contains runs: use agentflow.load_runs")
    raise RunError(f"{place} {what}: choose a directory that agentflow has written")
