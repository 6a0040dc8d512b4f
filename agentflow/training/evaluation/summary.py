"""The numbers of judged replies: validity, scores, Best@N, with intervals."""

from __future__ import annotations

import statistics
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from agentflow.metrics.scores import Scores
from agentflow.metrics.validity import Rate
from agentflow.training.evaluation.replies import JudgedReply


@dataclass(frozen=True)
class Summary:
    """Numbers of replies to one task, without those that met an infrastructure fault."""

    replies: int
    """Replies that count."""
    faults: int
    """Replies left out because their simulation crashed or timed out."""
    parsed: Rate
    spatial: Rate
    valid: Rate
    scores: Scores
    seed: int
    """Of the bootstrap."""

    @property
    def mean(self) -> float | None:
        """Mean score over all replies, 0 for each without a valid machine; None if none counts."""
        return self.scores.mean_all

    @property
    def sd(self) -> float | None:
        """Population standard deviation over all replies, as published; None if none counts."""
        return statistics.pstdev(self.scores.all) if self.replies else None

    def to_json(self) -> dict[str, Any]:
        """Plain numbers; shares as count and interval."""
        return {
            "replies": self.replies,
            "faults": self.faults,
            **{name: getattr(self, name).to_json() for name in ("parsed", "spatial", "valid")},
            "mean": self.mean,
            "mean_interval": self.scores.mean_all_interval(self.seed),
            "mean_valid": self.scores.mean_valid,
            "mean_valid_interval": self.scores.mean_valid_interval(self.seed),
            "sd": self.sd,
            "max": self.scores.max,
            "best_at": self.scores.best_at(),
        }


def summarise(replies: Iterable[JudgedReply], seed: int = 0) -> Summary:
    """The numbers of replies to one task; see `Summary`.

    Args:
        replies: In any order.
        seed: Random seed of the bootstrap.
    """
    every = list(replies)
    counted = [reply for reply in every if not reply.fault]
    scores = tuple(reply.score for reply in counted if reply.valid and reply.score is not None)
    return Summary(
        replies=len(counted),
        faults=len(every) - len(counted),
        parsed=Rate(sum(reply.parsed for reply in counted), len(counted)),
        spatial=Rate(sum(reply.spatial for reply in counted), len(counted)),
        valid=Rate(len(scores), len(counted)),
        scores=Scores(scores, len(counted) - len(scores)),
        seed=seed,
    )
