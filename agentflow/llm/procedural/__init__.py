"""Owns the embedded default model: rules and chance that answer every role's prompt in text.

No language model. It reads the prompt and nothing else; equal requests get equal replies.
"""

from __future__ import annotations

import hashlib
import random
from collections.abc import Callable, Mapping

from agentflow.llm.messages import Reply, Request, Usage
from agentflow.llm.procedural.designing import design, plan
from agentflow.llm.procedural.inspecting import inspect, query
from agentflow.llm.procedural.reading import Facts, read_facts
from agentflow.llm.procedural.refining import refine

__all__ = ["ProceduralClient"]

_APOLOGY = (
    "Sorry, this prompt asks for nothing that I can do. I am a procedural designer and no language "
    "model: I answer the prompts of the machine-design roles only."
)
_ANSWERS: Mapping[str, Callable[[Facts, random.Random], str]] = {
    "meta_designer": plan,
    "designer": design,
    "inspector": inspect,
    "querier": query,
    "refiner": refine,
}


class ProceduralClient:
    """Answers prompts of every role without a language model (spec 4.1)."""

    def __init__(self, seed: int) -> None:
        """Every seed is another designer; the chance of a reply follows from it and the request."""
        self._seed = seed

    @property
    def name(self) -> str:
        """Shown wherever a result is."""
        return "procedural (no language model)"

    async def complete(self, request: Request) -> Reply:
        """Answer one request; what cannot be read is answered with an apology."""
        facts = read_facts(request.messages)
        text = _ANSWERS[facts.role](facts, self._chance(request)) if facts else _APOLOGY
        return Reply(text=text, usage=Usage(), model=self.name)

    async def aclose(self) -> None:
        """Nothing to release."""

    def _chance(self, request: Request) -> random.Random:
        told = [f"{message.role}\0{message.text}" for message in request.messages]
        key = "\0".join([str(self._seed), str(request.sampling.seed), request.label, *told])
        return random.Random(int.from_bytes(hashlib.sha256(key.encode()).digest()[:8], "big"))
