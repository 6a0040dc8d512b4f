"""Reward functions for verl; need nothing but agentflow itself.

A row of the data set names the level as its ground truth; `extra_info` may hold `seed` and `knobs`.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from agentflow.env.physics.engine import AUTO
from agentflow.rewards import Reward, Sample, read_knobs, require_score, shared_scorer


def compute_score(
    data_source: str,
    solution_str: str,
    ground_truth: str,
    extra_info: Mapping[str, Any] | None = None,
    *,
    engine: str = AUTO,
    workers: int = 1,
    **_: object,
) -> dict[str, float]:
    """Score a machine by simulation, in a worker process.

    Args:
        data_source: Name of the data set, by which verl groups its metrics.
        solution_str: Reply of the model.
        ground_truth: Level, such as "throwing/3".
        extra_info: May hold `seed`, the random seed of the task's trials, and `knobs`, the knobs
            of the level to change, as a mapping or JSON text.
        engine: Physics engine.
        workers: Worker processes of each of verl's reward workers.

    Returns:
        The score, 0 without a valid machine; and whether the reply has a machine (`parsed`), the
        machine has no overlaps and fits the size limit (`spatial`) and obeys every rule (`valid`).

    Raises:
        NoScoreError: The simulation timed out or crashed. verl's trainer then leaves the reply
            out of its group; it has no value that says so.
        UsageError: The task, knob or engine does not exist.
    """
    scores = compute_scores(
        [data_source], [solution_str], [ground_truth], [extra_info], engine=engine, workers=workers
    )
    return scores[0]


def compute_scores(
    data_sources: Sequence[str],  # noqa: ARG001 - verl passes it by name
    solution_strs: Sequence[str],
    ground_truths: Sequence[str],
    extra_infos: Sequence[Mapping[str, Any] | None],
    *,
    engine: str = AUTO,
    workers: int | None = None,
    **_: object,
) -> list[dict[str, float]]:
    """Like `compute_score`, for a whole batch; by default with one worker per processor."""
    samples = [
        _sample(text, task, extra or {}, engine)
        for text, task, extra in zip(solution_strs, ground_truths, extra_infos, strict=True)
    ]
    rewards = shared_scorer(workers).rewards(samples)
    return list(map(_parts, rewards, ground_truths))


def _sample(text: str, task: str, extra: Mapping[str, Any], engine: str) -> Sample:
    seed, knobs = int(extra.get("seed") or 0), read_knobs(extra.get("knobs"))
    return Sample(task, text, seed, knobs, engine)


def _parts(reward: Reward, task: str) -> dict[str, float]:
    """What verl averages in its metrics."""
    return {
        "score": require_score(reward, task),
        "parsed": float(reward.parsed),
        "spatial": float(bool(reward.spatial)),
        "valid": float(reward.valid),
    }
