"""Requests, replies, tool calls and token usage; and the interface that every model implements."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import Annotated, Any, ClassVar, Literal, Protocol

from pydantic import (
    AfterValidator,
    BaseModel,
    Field,
    SerializerFunctionWrapHandler,
    model_serializer,
)

Finish = Literal["stop", "length", "empty", "tool_calls", "content_filter"]
"""Why a reply ended. `stop` is a complete answer; `tool_calls` has no text, only tool calls."""
CHARS_PER_TOKEN = 4
"""Typical ratio for English and JSON; used only where the true count is unknown."""


def fix_surrogates(text: str) -> str:
    """Join surrogate pairs and replace lone surrogates, which cannot be encoded as UTF-8.

    Streams may split an emoji into two escapes, and replies may contain half of one in their JSON.
    """
    if text.isascii():
        return text
    return text.encode("utf-16-le", "surrogatepass").decode("utf-16-le", "replace")


Text = Annotated[str, AfterValidator(fix_surrogates)]


class _Frozen(BaseModel, frozen=True, extra="forbid"):
    pass


class Recorded(_Frozen):
    """A part of a call on record, without optional fields that have their default value."""

    optional_fields: ClassVar[frozenset[str]]
    """Left out of the record, so that a call without them keeps its key over versions."""

    @model_serializer(mode="wrap")
    def _leave_out_defaults(self, dump: SerializerFunctionWrapHandler) -> dict[str, Any]:
        defaults = {
            name
            for name in self.optional_fields
            if getattr(self, name) == type(self).model_fields[name].default
        }
        return {name: value for name, value in dump(self).items() if name not in defaults}


class Tool(_Frozen):
    """A tool that a model may call.

    Attributes:
        parameters: JSON schema of its arguments, which are an object.
    """

    name: str
    description: str
    parameters: Mapping[str, Any]


class NamedTool(_Frozen):
    """The tool that a reply must call."""

    name: str


class ToolCall(Recorded):
    """A tool call as a model wrote it: data that may be anything.

    Attributes:
        id: Not empty, and different from those of the other calls of the reply.
        arguments: The text that the model wrote: a JSON object if it kept to the schema.
        extra_content: JSON that some endpoints add and want back with the call, such as a
            signature.
    """

    optional_fields = frozenset({"extra_content"})

    id: Text
    name: Text
    arguments: Text
    extra_content: Text = ""


class Message(Recorded):
    """One message of a conversation.

    A reply with tool calls is followed by one `tool` message for each of them, in their order.

    Attributes:
        role: Who speaks: `tool` answers a tool call.
        text: What is said.
        images: PNG data URLs, of user and tool messages.
        tool_calls: The tools that an assistant message calls.
        tool_call_id: The call that a tool message answers.
        extra: Other fields that the endpoint wants back with an assistant message that calls tools.
    """

    optional_fields = frozenset({"tool_calls", "tool_call_id", "extra"})

    role: Literal["system", "user", "assistant", "tool"]
    text: Text
    images: tuple[str, ...] = ()
    tool_calls: tuple[ToolCall, ...] = ()
    tool_call_id: Text = ""
    extra: Mapping[str, str] = {}


class JsonSchema(_Frozen):
    """A JSON schema for replies; endpoints that do not support one are asked for a JSON object.

    Attributes:
        name: Name of the schema.
        content: The schema itself.
    """

    name: str
    content: Mapping[str, Any]


class Sampling(_Frozen):
    """Sampling parameters.

    Attributes:
        temperature: 0 always takes the likeliest token.
        top_p: Sample from the likeliest tokens with this total probability.
        max_tokens: Maximum number of output tokens; None uses the endpoint's default.
        seed: Random seed sent to the endpoint.
        stop: Texts that end a reply.
        response_format: Text, json_object, or a JSON schema for replies.
    """

    temperature: float = Field(0.7, ge=0, allow_inf_nan=False)
    top_p: float = Field(0.95, gt=0, le=1)
    max_tokens: int | None = None
    seed: int | None = None
    stop: tuple[str, ...] = ()
    response_format: Literal["text", "json_object"] | JsonSchema = "text"


class Request(Recorded):
    """One call to a model.

    `label` identifies the call within the run ("refiner/traj-3/node-12/attempt-2"). Two calls with
    the same messages but different labels are separate samples. Which reply a call gets never
    depends on what runs at the same time.

    Attributes:
        role: Role that asks.
        label: What distinguishes the call from all others of the run.
        messages: The conversation so far.
        sampling: How the reply is sampled.
        tools: Tools that the reply may call.
        tool_choice: `auto`: the reply may call tools; `none`: it must not; `required`: it must; or
            the tool to call.
        run: Name of the run directory, for functions in place of models; not recorded.
        run_seed: Random seed of the run, for functions in place of models; not recorded.
    """

    optional_fields = frozenset({"tools", "tool_choice"})

    role: str
    label: str
    messages: tuple[Message, ...]
    sampling: Sampling = Sampling()
    tools: tuple[Tool, ...] = ()
    tool_choice: Literal["auto", "none", "required"] | NamedTool = "auto"
    run: str = Field("", exclude=True)
    run_seed: int | None = Field(None, exclude=True)

    @property
    def estimated_tokens(self) -> int:
        """Estimated number of prompt tokens."""
        texts = [message.text for message in self.messages]
        calls = [call for message in self.messages for call in message.tool_calls]
        schemas = [json.dumps(tool.model_dump(mode="json")) for tool in self.tools]
        return estimate_tokens(*texts, *_texts_of(calls), *schemas)


class Usage(_Frozen):
    """Token counts as the endpoint reports them; 0 where it reports none.

    Attributes:
        prompt: Tokens of the prompt, including cached ones.
        completion: Tokens of the reply, including reasoning.
        reasoning: Tokens of the reasoning.
        cached: Tokens of the prompt that the endpoint had cached.
    """

    prompt: int = 0
    completion: int = 0
    reasoning: int = 0
    cached: int = 0

    @property
    def total(self) -> int:
        """Prompt and completion tokens together (completion includes reasoning)."""
        return self.prompt + self.completion

    def __add__(self, other: Usage) -> Usage:
        both = self.model_dump(), other.model_dump()
        return Usage(**{name: sum(each[name] for each in both) for name in both[0]})


class Reply(Recorded):
    """One reply. Roles parse `text`; reasoning is kept separately.

    Attributes:
        text: The text of the reply, without reasoning.
        finish: Why the reply ended.
        reasoning: The reasoning, if the endpoint sends it.
        usage: Tokens that the call took.
        model: Model name reported by the endpoint.
        latency_s: Seconds from the request to the end of the reply.
        retries: Attempts that failed before this one.
        tool_calls: Calls of the request's tools, perhaps beside a text.
        reasoning_field: Field in which reasoning came beside tool calls; some endpoints want it
            back there.
    """

    optional_fields = frozenset({"tool_calls", "reasoning_field"})

    text: str
    finish: Finish = "stop"
    reasoning: str = ""
    usage: Usage = Usage()
    model: str = ""
    latency_s: float = 0.0
    retries: int = 0
    tool_calls: tuple[ToolCall, ...] = ()
    reasoning_field: str = ""

    @property
    def message(self) -> Message:
        """This reply as a message of a conversation."""
        extra = {self.reasoning_field: self.reasoning} if self.reasoning_field else {}
        return Message(role="assistant", text=self.text, tool_calls=self.tool_calls, extra=extra)

    @property
    def estimated_tokens(self) -> int:
        """Estimated number of completion tokens, for endpoints that report none."""
        return estimate_tokens(self.text, self.reasoning, *_texts_of(self.tool_calls))


def estimate_tokens(*texts: str) -> int:
    """Estimated number of tokens of texts."""
    return -(-sum(map(len, texts)) // CHARS_PER_TOKEN)


def _texts_of(calls: Iterable[ToolCall]) -> list[str]:
    return [text for call in calls for text in (call.name, call.arguments)]


class Client(Protocol):
    """Answers requests; safe to call concurrently from one event loop."""

    @property
    def name(self) -> str:
        """Model name shown in results, for instance `procedural (no language model)`."""

    async def complete(self, request: Request) -> Reply:
        """Answer one request.

        Raises:
            EndpointError: The endpoint cannot be used.
            BudgetSpentError: A call, token or cost limit is reached.
            ReplayMissError: The request was not recorded (replay only).
        """

    async def aclose(self) -> None:
        """Release connections and files; the client cannot be used afterwards."""


class ClientWrapper:
    """Base of clients that wrap another client."""

    def __init__(self, inner: Client) -> None:
        self._inner = inner
        self.name = inner.name

    async def aclose(self) -> None:
        """Close the inner client."""
        await self._inner.aclose()
