"""Answers of the judge."""

from __future__ import annotations

import random

from agentflow.llm.procedural.reading import PromptContent


def praise(prompt: PromptContent, rng: random.Random) -> str:
    """Like any machine."""
    return f"{rng.choice(('A good', 'A fine'))} machine of {len(prompt.machine)} blocks."
