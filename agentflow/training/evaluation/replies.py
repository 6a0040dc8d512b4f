"""Replies of models, judged by simulation."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence

from pydantic import BaseModel, Field

from agentflow.machine.tree import MachineJson
from agentflow.rewards import Reward
from agentflow.rewards.scoring import Sample, Scorer


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
