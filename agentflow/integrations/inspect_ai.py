"""Inspect AI: one task per family, `agentflow/throwing` and so on, with all levels as samples.

Inspect finds this module by its entry point and tasks by their names in its registry, so families
from other distributions are there as well.
"""

from __future__ import annotations

import os
from typing import Any

from inspect_ai import Task, task
from inspect_ai.dataset import MemoryDataset, Sample
from inspect_ai.model import ChatMessage, ChatMessageSystem, ChatMessageUser
from inspect_ai.scorer import Score, Scorer, Target, mean, scorer, stderr
from inspect_ai.solver import TaskState, generate
from inspect_ai.util import concurrency

import agentflow
from agentflow.env.archive import rollout_json
from agentflow.env.pool.pool import RolloutPool
from agentflow.env.tasks.registry import FAMILIES, get_level, task_names
from agentflow.rewards import Reward, reward_async


def _register_task(family: str) -> None:
    """Register the task of a family with Inspect."""

    @task(name=family)
    def design(seed: int = 0, engine: str = "auto", prompts: str = "default") -> Task:
        """Design a machine for each level of the family.

        Args:
            seed: Random seed of the levels' trials.
            engine: Physics engine.
            prompts: Prompt set.
        """
        levels = [name for name in task_names() if name.partition("/")[0] == family]
        return Task(
            dataset=MemoryDataset([_sample(name, engine, prompts) for name in levels], family),
            solver=generate(),
            scorer=simulation(seed, engine),
            version=agentflow.__version__,
        )


def _sample(name: str, engine: str, prompts: str) -> Sample:
    """The sample of a level; its target is a good score."""
    system, user = agentflow.design_prompt(name, engine=engine, prompts=prompts)
    messages: list[ChatMessage] = [
        ChatMessageSystem(content=system["content"]),
        ChatMessageUser(content=user["content"]),
    ]
    return Sample(id=name, input=messages, target=str(get_level(name).file.good))


@scorer(metrics={"score": [mean(), stderr()], "valid": [mean()]})
def simulation(seed: int = 0, engine: str = "auto") -> Scorer:
    """Simulate the machine in a reply.

    The value has `score`, in the task's unit and 0 for an invalid machine, and `valid`. A reply
    whose simulation timed out or crashed is unscored: metrics leave it out and count it.

    Args:
        seed: Random seed of the level's trials.
        engine: Physics engine.
    """

    async def score(state: TaskState, target: Target) -> Score:  # noqa: ARG001
        async with concurrency("simulations", os.cpu_count() or 1), RolloutPool(1) as pool:
            found = await reward_async(
                str(state.sample_id), state.output.completion, pool, seed, engine=engine
            )
        return _score(found)

    return score


def _score(found: Reward) -> Score:
    rollout = found.rollout
    given: dict[str, Any] = {
        "answer": None if found.machine is None else found.machine.to_text(),
        "explanation": rollout.feedback.text,
        "metadata": rollout_json(rollout),
    }
    if found.value is None:
        return Score.unscored(reason="scoring_failed", **given)
    return Score(
        value={"score": found.value, "valid": found.valid},
        reason=None if found.parsed else "invalid_response_format",
        **given,
    )


for _family in FAMILIES:
    _register_task(_family)
