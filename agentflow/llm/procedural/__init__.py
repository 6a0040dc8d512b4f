"""The built-in default model: answers every role's prompt with rules and random choices.

It is not a language model. It reads only the prompt, and equal requests get equal replies.
"""

from __future__ import annotations

import random

from agentflow.llm.messages import Finish, Reply, Request
from agentflow.llm.procedural.designing import design, plan
from agentflow.llm.procedural.inspecting import inspect, query
from agentflow.llm.procedural.mechanisms import load_data
from agentflow.llm.procedural.placing import place_cogs
from agentflow.llm.procedural.reading import read_prompt
from agentflow.llm.procedural.refining import refine
from agentflow.llm.procedural.working import choose_calls

_ANSWERS = {"machine_structure": plan, "First the rationale": design,
            "<Three-Dimensional Perception of the World>": inspect, "<Required Feedback>": query,
            "<Modification Steps>": refine, "Place cogs": place_cogs}  # fmt: skip
"""Text in the requested reply format -> function that answers it."""


class ProceduralClient:
    """Answers prompts of every role without a language model."""

    name = "procedural (no language model)"

    def __init__(self, seed: int) -> None:
        """Random choices depend on `seed`, the request's sampling seed and its label.

        They do not depend on the prompt's text, so rewording a prompt changes no result.
        """
        self._seed = seed

    async def complete(self, request: Request) -> Reply:
        """Answer one request; prompts that cannot be read get an apology."""
        rng = random.Random(f"{self._seed}/{request.sampling.seed}/{request.label}")
        if request.tools:
            calls = choose_calls(request, rng)
            text = "" if calls else str(load_data("replies.yaml")["finished"])
            finish: Finish = "tool_calls" if calls else "stop"
            return Reply(text=text, finish=finish, model=self.name, tool_calls=calls)
        prompt = read_prompt(request.messages)
        reply_format = prompt.sections["Your reply"]
        answer = next((found for words, found in _ANSWERS.items() if words in reply_format), None)
        if answer is None or not (prompt.has_machine or answer in (plan, design)):
            return Reply(text=str(load_data("replies.yaml")["apology"]), model=self.name)
        return Reply(text=answer(prompt, rng), model=self.name)

    async def aclose(self) -> None:
        """Nothing to release."""
