"""Owns what passes between a role and a model: requests, replies, usage. No network, no files."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

Finish = Literal["stop", "length", "empty", "content_filter"]
"""Why a reply ended. Only `stop` is a whole answer."""
CHARS_PER_TOKEN = 4
"""A usual ratio for English and JSON; only used where the true count is not known."""


def mended(text: str) -> str:
    """The text with surrogates paired or replaced.

    A stream may cut an emoji into two escapes, and a reply may spell half of one inside its JSON;
    a lone surrogate is no text that could be sent or stored.
    """
    if text.isascii():
        return text
    return text.encode("utf-16-le", "surrogatepass").decode("utf-16-le", "replace")


class _Frozen(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class Message(_Frozen):
    """One message of a conversation; `images` are PNG data URLs (vision variant only)."""

    role: Literal["system", "user", "assistant"]
    text: Annotated[str, AfterValidator(mended)]
    images: tuple[str, ...] = ()


class JsonSchema(_Frozen):
    """A form that a reply must have; endpoints that know none are asked for any JSON object."""

    name: str
    content: Mapping[str, Any]
    """The schema itself."""


class Sampling(_Frozen):
    """How a reply is drawn. Defaults as published: temperature 0.7, top-p 0.95."""

    temperature: float = Field(0.7, ge=0, allow_inf_nan=False)
    top_p: float = Field(0.95, gt=0, le=1)
    max_tokens: int | None = None
    """Most output tokens; None leaves it to the endpoint."""
    seed: int | None = None
    stop: tuple[str, ...] = ()
    response_format: Literal["text", "json_object"] | JsonSchema = "text"


class Request(_Frozen):
    """One question to a model.

    `label` says which call of the run this is ("refiner/traj-3/node-12/attempt-2"): two calls with
    the same messages are different samples, and concurrency never changes which reply a call gets.
    """

    role: str
    label: str
    messages: tuple[Message, ...]
    sampling: Sampling = Sampling()

    @property
    def estimated_tokens(self) -> int:
        """Prompt tokens that this will probably be."""
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
    """One answer. `text` is what roles parse; reasoning is split off and kept beside it."""

    text: str
    finish: Finish = "stop"
    reasoning: str = ""
    usage: Usage = Usage()
    model: str = ""
    """The model's name as the endpoint answered it."""
    latency_s: float = 0.0
    retries: int = 0
