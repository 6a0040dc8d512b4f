"""Answers of the judge."""

from __future__ import annotations

import random

from agentflow.llm.procedural.reading import Prompt


def praise(prompt: Prompt, rng: random.Random) -> str:
    """Like any machine."""
    return f"{rng.choice(('A good', 'A fine'))} machine of {len(prompt.machine)} blocks."
