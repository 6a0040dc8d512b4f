"""Owns the JSON of `/chat/completions`: a request's body, and the reply gathered from an answer.

Sends nothing and knows no vendor by name; what servers refuse is in quirks.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field

from agentflow.llm.messages import Finish, JsonSchema, Message, Reply, Request, Usage, mended

_THOUGHT = re.compile(r"<think>(.*?)(?:</think>|\Z)", re.DOTALL)
_FINISH: dict[str, Finish] = {
    "length": "length",
    "max_tokens": "length",
    "model_length": "length",
    "content_filter": "content_filter",
    "safety": "content_filter",
    "refusal": "content_filter",
}
"""Finish reasons that are not a whole answer; all others count as `stop`."""
_BEGINNING = 4096
"""Characters told of what is no reply: no key may be cut in two before it is scrubbed."""


class BrokenAnswerError(Exception):
    """An answer that stops in the middle; asking again may help."""


class NoReplyError(Exception):
    """An answer that is something else than a chat completion."""


class ErrorObjectError(Exception):
    """An error object where a reply should be."""

    def __init__(self, content: Mapping[str, object]) -> None:
        super().__init__("error object")
        self.content = content


def request_body(request: Request, model: str) -> dict[str, object]:
    """The JSON body, asking for a stream. Sampling fields left at None or empty are not sent."""
    sampling = request.sampling
    body: dict[str, object] = {
        "model": model,
        "messages": [_message(message) for message in request.messages],
        "stream": True,
        "stream_options": {"include_usage": True},
        "temperature": sampling.temperature,
        "top_p": sampling.top_p,
    }
    if sampling.max_tokens is not None:
        body["max_tokens"] = sampling.max_tokens
    if sampling.seed is not None:
        body["seed"] = sampling.seed
    if sampling.stop:
        body["stop"] = list(sampling.stop)
    if isinstance(form := sampling.response_format, JsonSchema):
        schema = {"name": form.name, "schema": form.content}
        body["response_format"] = {"type": "json_schema", "json_schema": schema}
    elif form != "text":
        body["response_format"] = {"type": form}
    return body


def _message(message: Message) -> dict[str, object]:
    if not message.images:
        return {"role": message.role, "content": message.text}
    parts: list[dict[str, object]] = [{"type": "text", "text": message.text}]
    parts += [{"type": "image_url", "image_url": {"url": url}} for url in message.images]
    return {"role": message.role, "content": parts}


def decode(data: bytes) -> Mapping[str, object]:
    """One JSON object of an answer.

    Raises:
        BrokenAnswerError: It begins as JSON and does not end.
        NoReplyError: It is no JSON object.
        ErrorObjectError: It is an error object.
    """
    text = data.decode("utf-8", "replace").strip("\ufeff \t\r\n")
    try:
        content = json.loads(text)
    except (ValueError, RecursionError):
        if not text or text[0] in "{[":
            raise BrokenAnswerError("the answer's JSON breaks off") from None
        said = "an HTML page" if text[0] == "<" else f"it begins {text[:_BEGINNING]!r}"
        raise NoReplyError(said) from None
    if not isinstance(content, dict):
        raise NoReplyError(f"it is JSON of another kind: {text[:_BEGINNING]!r}")
    if content.get("error") or content.get("object") == "error":
        raise ErrorObjectError(content)
    return content


@dataclass
class Gathered:
    """A reply in the making, from one whole answer or from the chunks of a stream."""

    text: list[str] = field(default_factory=list)
    reasoning: list[str] = field(default_factory=list)
    refusal: list[str] = field(default_factory=list)
    finish: str = ""
    """The endpoint's own word; empty until it says one."""
    usage: Usage = field(default_factory=Usage)
    model: str = ""
    in_pieces: bool = False
    """Whether a chunk (`delta`) has said anything."""
    answered: bool = False
    """Whether any choice has been seen."""

    def add(self, content: Mapping[str, object]) -> None:
        """Take in a whole answer (`message`) or a chunk (`delta`)."""
        self.model = str(content.get("model") or self.model)
        if isinstance(usage := content.get("usage"), dict):
            self.usage = read_usage(usage)
        choices = content.get("choices")
        for choice in choices[:1] if isinstance(choices, list) else ():
            if not isinstance(choice, dict):
                raise NoReplyError("a choice is no object")
            self.answered = True
            self.finish = str(choice.get("finish_reason") or self.finish)
            delta, message = choice.get("delta"), choice.get("message")
            if isinstance(delta, dict) and any(delta[name] for name in delta if name != "role"):
                self._add_part(delta)
                self.in_pieces = True
            elif isinstance(message, dict):
                self._replace(message) if self.in_pieces else self._add_part(message)

    def _replace(self, message: Mapping[str, object]) -> None:
        """Take a whole message in place of what has come: some streams end with it."""
        whole = Gathered()
        whole._add_part(message)
        self.text = whole.text or self.text
        self.reasoning = whole.reasoning or self.reasoning
        self.refusal = whole.refusal or self.refusal

    def _add_part(self, part: Mapping[str, object]) -> None:
        for name in ("reasoning_content", "reasoning"):
            if isinstance(thought := part.get(name), str) and thought:
                self.reasoning.append(thought)
                break
        if isinstance(refusal := part.get("refusal"), str) and refusal:
            self.refusal.append(refusal)
        content = part.get("content")
        if isinstance(content, str) and content:
            self.text.append(content)
        elif isinstance(content, list):
            self._add_parts(content)

    def _add_parts(self, parts: list[object]) -> None:
        """Content as a list of typed parts, with thoughts possibly nested one level down."""
        for part in parts:
            if not isinstance(part, dict):
                continue
            if isinstance(text := part.get("text"), str):
                self.text.append(text)
            elif isinstance(thoughts := part.get("thinking"), list):
                self.reasoning += [
                    str(item.get("text", "")) for item in thoughts if isinstance(item, dict)
                ]

    def reply(self) -> Reply:
        """The reply, with its reasoning split off.

        Raises:
            NoReplyError: No choice was seen.
            BrokenAnswerError: The endpoint itself reports that it failed half-way.
        """
        if not self.answered:
            raise NoReplyError("it holds no choices")
        if self.finish == "error":
            raise BrokenAnswerError("the endpoint failed in the middle of its reply")
        text, thought = split_reasoning(mended("".join(self.text)))
        refusal = mended("".join(self.refusal))
        finish = _FINISH.get(self.finish.lower(), "stop")
        if refusal and not text:
            text, finish = refusal, "content_filter"
        if finish == "stop" and not text.strip():
            finish = "empty"
        reasoning = "\n".join(part for part in (mended("".join(self.reasoning)), thought) if part)
        return Reply(
            text=text,
            finish=finish,
            reasoning=reasoning,
            usage=self.usage,
            model=mended(self.model),
        )


def split_reasoning(text: str) -> tuple[str, str]:
    """Split `<think>...</think>` off a text.

    A closing tag without an opening one ends a thought that the endpoint's own template opened; an
    opening one without a closing one means that the reply ended inside the thought.

    Returns:
        The text without the thoughts, and the thoughts; without tags the text as it came.
    """
    if "</think>" not in text and "<think>" not in text:
        return text, ""
    opening, closing = text.find("<think>"), text.find("</think>")
    if closing >= 0 and (opening < 0 or closing < opening):
        text = "<think>" + text
    thoughts = [thought.strip() for thought in _THOUGHT.findall(text)]
    return _THOUGHT.sub("", text).lstrip(), "\n".join(thought for thought in thoughts if thought)


def read_usage(usage: Mapping[str, object]) -> Usage:
    """Token counts in the shapes that servers use; 0 for what is missing."""
    cached = _count(_details(usage, "prompt_tokens_details").get("cached_tokens"))
    return Usage(
        prompt=_count(usage.get("prompt_tokens")),
        completion=_count(usage.get("completion_tokens")),
        reasoning=_count(_details(usage, "completion_tokens_details").get("reasoning_tokens"))
        or _count(usage.get("reasoning_tokens")),
        cached=cached or _count(usage.get("prompt_cache_hit_tokens")),
    )


def _details(usage: Mapping[str, object], name: str) -> Mapping[str, object]:
    details = usage.get(name)
    return details if isinstance(details, dict) else {}


def _count(value: object) -> int:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return 0
    return int(value) if 0 <= value < 1e15 else 0
