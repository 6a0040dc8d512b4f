"""The built-in default model: answers every role's prompt with rules and random choices.

It is not a language model. It reads only the prompt, and equal requests get equal replies.
"""

import random
from collections.abc import Iterable

from agentflow.llm.messages import Finish, Reply, Request
from agentflow.llm.procedural.designing import choose_calls
from agentflow.llm.procedural.mechanisms import load_data
from agentflow.llm.procedural.reading import Script, read_prompt


class ProceduralClient:
    """Answers prompts of every role without a language model."""

    name = "procedural (no language model)"

    def __init__(self, seed: int, scripts: Iterable[Script]) -> None:
        """Play roles by these scripts.

        Random choices depend on `seed`, the request's sampling seed and its label. They do not
        depend on the prompt's text, so rewording a prompt changes no result.
        """
        self._seed, self._scripts = seed, tuple(scripts)

    async def complete(self, request: Request) -> Reply:
        """Answer one request; prompts that cannot be read get an apology."""
        rng = random.Random(f"{self._seed}/{request.sampling.seed}/{request.label}")
        if request.tools:
            calls = choose_calls(request, rng)
            text = "" if calls else str(load_data("replies.yaml")["finished"])
            finish: Finish = "tool_calls" if calls else "stop"
            return Reply(text=text, finish=finish, model=self.name, tool_calls=calls)
        prompt = read_prompt(request.messages)
        script = next((script for script in self._scripts if script.fits(prompt)), None)
        if script is None:
            return Reply(text=str(load_data("replies.yaml")["apology"]), model=self.name)
        return Reply(text=script.answer(prompt, rng), model=self.name)

    async def aclose(self) -> None:
        """Nothing to release."""
