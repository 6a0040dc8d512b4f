"""Requests, replies and token usage."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, Field

Finish = Literal["stop", "length", "empty", "tool_calls", "content_filter"]
"""Why a reply ended. Only `stop` is a complete answer; `tool_calls` has nothing else."""
CHARS_PER_TOKEN = 4
"""Typical ratio for English and JSON; used only where the true count is unknown."""


def fix_surrogates(text: str) -> str:
    """Join surrogate pairs and replace lone surrogates, which cannot be encoded as UTF-8.

    Streams may split an emoji into two escapes, and replies may contain half of one in their JSON.
    """
    if text.isascii():
        return text
    return text.encode("utf-16-le", "surrogatepass").decode("utf-16-le", "replace")


class _Frozen(BaseModel, frozen=True, extra="forbid"):
    pass


class Message(_Frozen):
    """One message of a conversation; `images` are PNG data URLs (vision variant only)."""

    role: Literal["system", "user", "assistant"]
    text: Annotated[str, AfterValidator(fix_surrogates)]
    images: tuple[str, ...] = ()


class JsonSchema(_Frozen):
    """A JSON schema for replies; endpoints that do not support one are asked for a JSON object."""

    name: str
    content: Mapping[str, Any]
    """The schema itself."""


class Sampling(_Frozen):
    """Sampling parameters."""

    temperature: float = Field(0.7, ge=0, allow_inf_nan=False)
    top_p: float = Field(0.95, gt=0, le=1)
    max_tokens: int | None = None
    """Maximum number of output tokens; None uses the endpoint's default."""
    seed: int | None = None
    stop: tuple[str, ...] = ()
    response_format: Literal["text", "json_object"] | JsonSchema = "text"


class Request(_Frozen):
    """One call to a model.

    `label` identifies the call within the run ("refiner/traj-3/node-12/attempt-2"). Two calls with
    the same messages are different samples, and concurrency never changes which reply a call gets.
    """

    role: str
    label: str
    messages: tuple[Message, ...]
    sampling: Sampling = Sampling()

    @property
    def estimated_tokens(self) -> int:
        """Estimated number of prompt tokens."""
        return -(-sum(len(message.text) for message in self.messages) // CHARS_PER_TOKEN)


class Usage(_Frozen):
    """Token counts as the endpoint reports them; 0 where it reports none."""

    prompt: int = 0
    completion: int = 0
    reasoning: int = 0
    cached: int = 0

    @property
    def total(self) -> int:
        """Prompt and completion tokens together (completion includes reasoning)."""
        return self.prompt + self.completion

    def __add__(self, other: Usage) -> Usage:
        return Usage(
            prompt=self.prompt + other.prompt,
            completion=self.completion + other.completion,
            reasoning=self.reasoning + other.reasoning,
            cached=self.cached + other.cached,
        )


class Reply(_Frozen):
    """One reply. Roles parse `text`; reasoning is kept separately."""

    text: str
    finish: Finish = "stop"
    reasoning: str = ""
    usage: Usage = Usage()
    model: str = ""
    """Model name reported by the endpoint."""
    latency_s: float = 0.0
    retries: int = 0
