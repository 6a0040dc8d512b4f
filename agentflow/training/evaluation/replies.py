"""Replies of models, judged by simulation, and their numbers."""

from __future__ import annotations

import asyncio
import statistics
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from pydantic import BaseModel, Field

from agentflow.machine.tree import MachineJson
from agentflow.metrics.cells import Scores
from agentflow.metrics.intervals import Rate
from agentflow.rewards import Reward, Sample, Scorer


class JudgedReply(BaseModel, frozen=True, extra="forbid"):
    """A reply to a task, and what the simulation of its machine found. One line of JSON files."""

    task: str
    """Level, such as "throwing/3"."""
    seed: int
    """Random seed of the task's trials."""
    text: str
    parsed: bool
    """Whether the reply contains a file-valid machine."""
    spatial: bool
    """Whether that machine has no overlaps and fits the size limit."""
    valid: bool
    """Whether that machine meets every rule of the task and was simulated."""
    status: str
    """ok, invalid, diverged, timeout or crashed."""
    problem: str = ""
    """Code of the first reason why there is no valid machine."""
    score: float | None = Field(allow_inf_nan=False)
    """In the unit of the task, 0 without a valid machine; None after an infrastructure fault (a
    simulation that crashed or timed out), which says nothing about the reply."""
    machine: MachineJson | None
    """The machine in the reply, as in machine files; None if the reply contains none."""

    @classmethod
    def of(cls, sample: Sample, reward: Reward) -> JudgedReply:
        """A reply and its reward."""
        return cls(
            task=sample.task,
            seed=sample.seed,
            text=sample.text,
            parsed=reward.parsed,
            spatial=bool(reward.spatial),
            valid=reward.valid,
            status=reward.status,
            problem=reward.problems[0].code if reward.problems and not reward.valid else "",
            score=reward.value,
            machine=None if reward.machine is None else reward.machine.to_json(),
        )

    @property
    def fault(self) -> bool:
        """Whether the simulation crashed or timed out, so that the reply has no score."""
        return self.score is None


def judge(samples: Sequence[Sample], scorer: Scorer) -> list[JudgedReply]:
    """Simulate the machines of replies in the scorer's worker processes.

    Raises:
        UsageError: A task, knob or engine does not exist.
    """
    pairs = zip(samples, scorer.rewards(samples), strict=True)
    return [JudgedReply.of(sample, reward) for sample, reward in pairs]


async def judge_async(samples: Sequence[Sample], scorer: Scorer) -> list[JudgedReply]:
    """Like `judge`, for callers with an event loop of their own; can be cancelled."""
    rewards = await asyncio.gather(*map(scorer.reward, samples))
    return [JudgedReply.of(*pair) for pair in zip(samples, rewards, strict=True)]


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


def summaries(
    replies: Sequence[JudgedReply], tasks: Iterable[str], seed: int = 0
) -> dict[str, Summary]:
    """Task -> the numbers of the replies to it."""
    return {task: summarise((r for r in replies if r.task == task), seed) for task in tasks}
