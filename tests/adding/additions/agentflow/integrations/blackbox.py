"""An objective for libraries that minimise functions of text."""

from __future__ import annotations

from agentflow.rewards import reward


def loss(text: str, task: str = "movement") -> float:
    """The negative score of the machine in a text; 0 without a score."""
    return -(reward(task, text).value or 0.0)
