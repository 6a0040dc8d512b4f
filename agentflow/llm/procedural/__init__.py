"""Owns the embedded default model: rules and chance that answer every role's prompt in text.

No language model. It reads the prompt and nothing else; equal requests get equal replies.
"""

from __future__ import annotations

import hashlib
import random

from agentflow.llm.messages import Reply, Request
from agentflow.llm.procedural.designing import design, plan
from agentflow.llm.procedural.inspecting import inspect, query
from agentflow.llm.procedural.mechanisms import data
from agentflow.llm.procedural.placing import place_cogs
from agentflow.llm.procedural.reading import read_facts
from agentflow.llm.procedural.refining import refine

_ANSWERS = {"machine_structure": plan, "First the rationale": design,
            "<Three-Dimensional Perception of the World>": inspect, "<Required Feedback>": query,
            "<Modification Steps>": refine, "Place cogs": place_cogs}  # fmt: skip
"""Words of a demanded reply format -> who answers it."""


class ProceduralClient:
    """Answers prompts of every role without a language model (spec 4.1)."""

    name = "procedural (no language model)"

    def __init__(self, seed: int) -> None:
        """Every seed is another designer; the chance of a reply follows from it and the request."""
        self._seed = seed

    async def complete(self, request: Request) -> Reply:
        """Answer one request; what cannot be read is answered with an apology."""
        facts = read_facts(request.messages)
        form = facts.parts["Your reply"]
        told = [f"{message.role}\0{message.text}" for message in request.messages]
        key = "\0".join([str(self._seed), str(request.sampling.seed), request.label, *told])
        chance = random.Random(hashlib.sha256(key.encode(errors="replace")).digest())
        answer = next((found for words, found in _ANSWERS.items() if words in form), None)
        able = answer and (facts.shown or answer in (plan, design))
        text = answer(facts, chance) if answer and able else str(data("replies.yaml")["apology"])
        return Reply(text=text, model=self.name)

    async def aclose(self) -> None:
        """Nothing to release."""
