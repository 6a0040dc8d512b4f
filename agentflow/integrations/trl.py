"""A reward function for TRL's `GRPOTrainer`; needs nothing but agentflow itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from agentflow.env.physics.engine import AUTO
from agentflow.rewards.scoring import Sample, read_knobs, shared_scorer

Completion = str | Sequence[Mapping[str, Any]]
"""Text, or the messages of a conversation."""


def simulation_reward(
    completions: Sequence[Completion],
    task: str | Sequence[str],
    seed: int | Sequence[int | None] | None = None,
    knobs: object = None,
    *,
    engine: str = AUTO,
    workers: int | None = None,
    **_: object,
) -> list[float | None]:
    """Score machines by simulation, a whole batch together in worker processes.

    `task`, `seed` and `knobs` are columns of the data set, or, with `functools.partial`, one value
    for all rows.

    Args:
        completions: Replies of the model.
        task: Levels, such as "throwing/3".
        seed: Random seeds of the tasks' trials; 0 where there is none.
        knobs: Knobs of the levels to change: mappings, or JSON text.
        engine: Physics engine.
        workers: Worker processes; by default one per processor.

    Returns:
        Scores; 0 without a valid machine. None if a simulation timed out or crashed, which says
        nothing about the reply: TRL leaves such completions out of the group's mean and does not
        learn from them.

    Raises:
        UsageError: A task, knob or engine does not exist.
    """
    count = len(completions)
    samples = [
        Sample(name, reply_text(completion), number or 0, read_knobs(changed), engine)
        for completion, name, number, changed in zip(
            completions,
            _column(task, count),
            _column(seed, count),
            _column(knobs, count),
            strict=True,
        )
    ]
    return [reward.value for reward in shared_scorer(workers).rewards(samples)]


def reply_text(completion: Completion) -> str:
    """The text of a completion; of a conversation, that of its last message."""
    if isinstance(completion, str):
        return completion
    content = completion[-1].get("content") if completion else None
    if isinstance(content, str) or not content:
        return content or ""
    return "\n".join(part["text"] for part in content if part.get("type") == "text")


def _column(value: Any, count: int) -> Sequence[Any]:
    """One value per row."""
    return value if isinstance(value, list | tuple) else [value] * count
