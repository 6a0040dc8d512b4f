"""The short prompt of tiny models: what is to be done, and with which blocks.

A model of a few million parameters cannot learn to read a prompt of four thousand tokens. It gets
the purpose that the procedural model reads out of the prompt's task, and the allowed types:
`throw 0 1 2 5 15 22 30 36<design>`. Its reply is a real one: a rationale, then a machine.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from agentflow.errors import UsageError
from agentflow.llm.messages import Message
from agentflow.llm.procedural.mechanisms import purpose
from agentflow.llm.procedural.reading import PromptContent, read_prompt

END = "<design>"
"""Special token that ends a short prompt; the reply follows."""
WHOLE = "First the rationale"
"""Words of the reply format of designers."""


def shorten(messages: Sequence[Mapping[str, str]]) -> str:
    """The short form of a prompt that asks for a whole machine.

    Args:
        messages: Chat messages with `role` and `content`. What follows the user's first message,
            such as a request to correct a reply, is left out: the model just tries again.

    Raises:
        UsageError: The prompt asks for something else.
    """
    content = {"system": messages[0]["content"], "user": ""}
    content |= {message["role"]: message["content"] for message in reversed(messages)}
    prompt = read_prompt(
        [Message(role="system", text=content["system"]), Message(role="user", text=content["user"])]
    )
    if not _asks_for_whole_machine(prompt):
        raise UsageError(
            "a model with short prompts writes whole machines as construction trees, and nothing "
            "else; use another model, or a workflow and settings that ask for nothing else, such "
            "as --workflow single --set search.rounds=0"
        )
    return f"{purpose(prompt.brief)} {' '.join(map(str, prompt.brief.blocks))}{END}"


def _asks_for_whole_machine(prompt: PromptContent) -> bool:
    other = ("Structure to build now", "Rationale to follow")
    return (
        WHOLE in prompt.sections["Your reply"]
        and not prompt.has_machine
        and not prompt.coordinates
        and not any(prompt.sections[heading] for heading in other)
    )
