"""Replies built from the JSON that `/chat/completions` answers, and their tool calls.

Servers differ: calls without indices or ids, one index for all calls, an id in every chunk, names
in pieces or repeated, arguments as an object instead of text, or `function_call` for a single call.
"""

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import count

from agentflow.llm.messages import Finish, Reply, ToolCall, Usage, fix_surrogates


@dataclass
class _Call:
    """A call of which more pieces may come."""

    id: str = ""
    name: str = ""
    arguments: list[str] = field(default_factory=list)
    extra_content: str = ""

    def add(self, entry: Mapping[str, object]) -> None:
        self.id = self.id or _text(entry.get("id"))
        function = _function_in(entry)
        if (name := _text(function.get("name"))) != self.name:
            self.name += name
        arguments = function.get("arguments")
        if isinstance(arguments, str):
            self.arguments.append(arguments)
        elif arguments is not None:
            self.arguments = [_json(arguments)]
        if extra := entry.get("extra_content"):
            self.extra_content = _json(extra)

    def goes_on_with(self, entry: Mapping[str, object]) -> bool:
        """Whether an entry at the same place adds to this call; otherwise it is another call."""
        if not _text(_function_in(entry).get("name")):
            return True
        if self.id and (other := _text(entry.get("id"))):
            return self.id == other
        return not is_json_object("".join(self.arguments))

    def finish(self, key: str) -> ToolCall:
        return ToolCall(
            id=key,
            name=self.name,
            arguments="".join(self.arguments),
            extra_content=self.extra_content,
        )


class ToolCallBuilder:
    """Builds tool calls from the `tool_calls` or `function_call` of messages and chunks."""

    def __init__(self) -> None:
        self._calls: list[_Call] = []
        self._latest: dict[int | str, _Call] = {}
        """The latest call at each index, or at each place in lists without indices."""

    def add(self, part: Mapping[str, object]) -> None:
        """Add the calls, or pieces of calls, of a message or a chunk."""
        entries = part.get("tool_calls") or part.get("function_call")
        for place, entry in enumerate(entries if isinstance(entries, list) else [entries]):
            if isinstance(entry, dict):
                index = entry.get("index")
                self._add_at(index if isinstance(index, int) else f"place {place}", entry)

    def _add_at(self, place: int | str, entry: Mapping[str, object]) -> None:
        call = self._latest.get(place)
        if call is None or not call.goes_on_with(entry):
            call = self._latest[place] = _Call()
            self._calls.append(call)
        call.add(entry)

    def finish(self) -> tuple[ToolCall, ...]:
        """The calls in order, without empty ones; a missing or repeated id is replaced."""
        calls = [call for call in self._calls if call.name or any(call.arguments)]
        given = {call.id for call in calls}
        # nine letters and digits, because some endpoints reject other ids
        spare = (key for number in count() if (key := f"call{number:05d}") not in given)
        finished: dict[str, ToolCall] = {}
        for call in calls:
            key = call.id if call.id and call.id not in finished else next(spare)
            finished[key] = call.finish(key)
        return tuple(finished.values())


def is_json_object(text: str) -> bool:
    """Whether a text is one JSON object."""
    try:
        return isinstance(json.loads(text), dict)
    except (ValueError, RecursionError):
        return False


def _function_in(entry: Mapping[str, object]) -> Mapping[str, object]:
    function = entry.get("function")
    return function if isinstance(function, dict) else entry


def _text(value: object) -> str:
    return fix_surrogates(value) if isinstance(value, str) else ""


def _json(value: object) -> str:
    """A value as JSON text that can be sent back; empty for NaN and too deep nesting."""
    try:
        return fix_surrogates(json.dumps(value, ensure_ascii=False, allow_nan=False))
    except (ValueError, RecursionError):
        return ""


_THOUGHT = re.compile(r"<think>(.*?)(?:</think>|\Z)", re.DOTALL)
_FINISH: dict[str, Finish] = {
    "length": "length",
    "max_tokens": "length",
    "model_length": "length",
    "content_filter": "content_filter",
    "safety": "content_filter",
    "refusal": "content_filter",
}
"""Finish reasons of incomplete answers; all others count as `stop`."""
_EXCERPT_CHARS = 4096
"""Length of excerpts in errors, long enough not to cut a key in two before it is masked."""


class TruncatedAnswerError(Exception):
    """An answer that ends early; a retry may help."""


class NotACompletionError(Exception):
    """An answer that is not a chat completion."""


class ErrorObjectError(Exception):
    """An error object instead of a reply."""

    def __init__(self, content: Mapping[str, object]) -> None:
        super().__init__("error object")
        self.content = content


def decode(answer: str) -> Mapping[str, object]:
    """Parse one JSON object of an answer.

    Raises:
        TruncatedAnswerError: The JSON is incomplete.
        NotACompletionError: It is not a JSON object.
        ErrorObjectError: It is an error object.
    """
    text = answer.strip("\ufeff \t\r\n")
    try:
        content = json.loads(text)
    except (ValueError, RecursionError):
        if not text or text[0] in "{[":
            raise TruncatedAnswerError("the answer's JSON is incomplete") from None
        what = "an HTML page" if text[0] == "<" else f"it starts with {text[:_EXCERPT_CHARS]!r}"
        raise NotACompletionError(what) from None
    if not isinstance(content, dict):
        raise NotACompletionError(f"JSON that is not an object: {text[:_EXCERPT_CHARS]!r}")
    if content.get("error") or content.get("object") == "error":
        raise ErrorObjectError(content)
    return content


@dataclass
class ReplyBuilder:
    """Builds a reply from one complete answer or from the chunks of a stream."""

    text: list[str] = field(default_factory=list)
    reasoning: list[str] = field(default_factory=list)
    refusal: list[str] = field(default_factory=list)
    finish: str = ""
    """Finish reason in the endpoint's terms; empty until received."""
    usage: Usage = field(default_factory=Usage)
    model: str = ""
    streamed: bool = False
    """Whether a non-empty chunk (`delta`) was received."""
    has_choice: bool = False
    tool_calls: ToolCallBuilder = field(default_factory=ToolCallBuilder)
    reasoning_field: str = ""
    """Field in which the endpoint sends reasoning; empty until received."""

    def add(self, content: Mapping[str, object]) -> None:
        """Add a complete answer (`message`) or a chunk (`delta`)."""
        self.model = str(content.get("model") or self.model)
        if isinstance(usage := content.get("usage"), dict):
            self.usage = read_usage(usage)
        choices = content.get("choices")
        for choice in choices[:1] if isinstance(choices, list) else ():
            if not isinstance(choice, dict):
                raise NotACompletionError("a choice is not an object")
            self.has_choice = True
            self.finish = str(choice.get("finish_reason") or self.finish)
            delta, message = choice.get("delta"), choice.get("message")
            if isinstance(delta, dict) and any(delta[name] for name in delta if name != "role"):
                self._add_content(delta)
                self.streamed = True
            elif isinstance(message, dict):
                self._replace(message) if self.streamed else self._add_content(message)

    def _replace(self, message: Mapping[str, object]) -> None:
        """Replace the chunks so far by a complete message, with which some streams end."""
        whole = ReplyBuilder()
        whole._add_content(message)
        self.text = whole.text or self.text
        self.reasoning = whole.reasoning or self.reasoning
        self.refusal = whole.refusal or self.refusal
        if whole.tool_calls.finish():
            self.tool_calls = whole.tool_calls

    def _add_content(self, part: Mapping[str, object]) -> None:
        for name in ("reasoning_content", "reasoning"):
            if isinstance(thought := part.get(name), str) and thought:
                self.reasoning.append(thought)
                self.reasoning_field = name
                break
        if isinstance(refusal := part.get("refusal"), str) and refusal:
            self.refusal.append(refusal)
        self.tool_calls.add(part)
        content = part.get("content")
        if isinstance(content, str) and content:
            self.text.append(content)
        elif isinstance(content, list):
            self._add_typed_parts(content)

    def _add_typed_parts(self, parts: list[object]) -> None:
        """Add content given as a list of typed parts, with reasoning possibly nested one level."""
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
        """The finished reply, with reasoning separated from text.

        Raises:
            NotACompletionError: No choice was received.
            TruncatedAnswerError: The endpoint reports that it failed while replying.
        """
        if not self.has_choice:
            raise NotACompletionError("no choices")
        if self.finish == "error":
            raise TruncatedAnswerError("the endpoint failed while replying")
        text, thought = split_reasoning(fix_surrogates("".join(self.text)))
        refusal = fix_surrogates("".join(self.refusal))
        calls = self.tool_calls.finish()
        finish = _FINISH.get(self.finish.lower(), "stop")
        if refusal and not text:
            text, finish = refusal, "content_filter"
        if finish == "stop" and not text.strip():
            finish = "tool_calls" if calls else "empty"
        reasoning = "\n".join(
            part for part in (fix_surrogates("".join(self.reasoning)), thought) if part
        )
        return Reply(
            text=text,
            finish=finish,
            reasoning=reasoning,
            usage=self.usage,
            model=fix_surrogates(self.model),
            tool_calls=calls,
            reasoning_field=self.reasoning_field if calls else "",
        )


def split_reasoning(text: str) -> tuple[str, str]:
    """Separate `<think>...</think>` from a text.

    A lone closing tag ends reasoning that the endpoint's chat template opened; a lone opening tag
    means that the reply ended while reasoning.

    Returns:
        The text without reasoning, and the reasoning.
    """
    if "</think>" not in text and "<think>" not in text:
        return text, ""
    opening, closing = text.find("<think>"), text.find("</think>")
    if closing >= 0 and (opening < 0 or closing < opening):
        text = "<think>" + text
    thoughts = [thought.strip() for thought in _THOUGHT.findall(text)]
    return _THOUGHT.sub("", text).lstrip(), "\n".join(thought for thought in thoughts if thought)


def read_usage(usage: Mapping[str, object]) -> Usage:
    """Read token counts in the formats that servers use; 0 where missing."""
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
