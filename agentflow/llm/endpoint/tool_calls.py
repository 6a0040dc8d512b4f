"""Tool calls of a reply, from a complete message or from the chunks of a stream.

Servers differ: calls without indices or ids, one index for all calls, an id in every chunk, names
in pieces or repeated, arguments as an object instead of text, or `function_call` for a single call.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import count

from agentflow.llm.messages import ToolCall, fix_surrogates


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
