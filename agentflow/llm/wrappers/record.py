"""Clients around the record of a run's calls, `calls.jsonl`: one records and resumes, the other
only replays."""

from __future__ import annotations

import asyncio
import hashlib
import json
from collections.abc import Callable, Iterator
from difflib import SequenceMatcher
from itertools import takewhile
from pathlib import Path
from typing import Literal

from pydantic import NonNegativeInt, ValidationError

from agentflow.errors import BudgetSpentError, DamagedError, ReplayMissError
from agentflow.files.atomic import os_errors
from agentflow.files.chains import Chains
from agentflow.files.faults import locate_fault
from agentflow.files.lines import LineFile, read_lines
from agentflow.llm.messages import Client, ClientWrapper, Message, Recorded, Reply, Request


class RecordedCall(Recorded):
    """One line of the call log. Prompts and replies only: no base URL, no key, no timeouts."""

    optional_fields = frozenset({"after", "shared"})

    schema_version: Literal[1] = 1
    key: str
    model: str
    """Name of the model in the configuration."""
    request: Request
    reply: Reply
    after: str = ""
    """In the file: key of the call whose conversation this one continues."""
    shared: NonNegativeInt = 0
    """In the file: number of messages, of that call and then its reply, with which those of this
    request begin; the request holds only the others."""

    @property
    def conversation(self) -> tuple[Message, ...]:
        """The messages, the reply included."""
        return (*self.request.messages, self.reply.message)


def key_of(model: str, request: Request) -> str:
    """Hash of the label and of everything that affects the reply."""
    content = {"model": model, "request": request.model_dump(mode="json")}
    text = json.dumps(content, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


class CallLog:
    """A record of calls on disk; in memory are the offset of each line, and the conversations with
    tools that later calls may continue.

    Args:
        path: The file; created if missing and `writable`.
        notice: Called with one line of text about a half-written last line, which is skipped, and
            removed if `writable`. A last line that only lacks its line break is kept.
        writable: Whether lines will be appended.

    Raises:
        RunError: The file cannot be opened, or a line other than the last is damaged.
    """

    def __init__(self, path: Path, notice: Callable[[str], None], *, writable: bool = True) -> None:
        self.path = path
        self._offsets: dict[str, int] = {}
        self._conversations = Chains[Message]()
        self._lines: LineFile | None = None
        try:
            with os_errors(f"cannot open {path}"):
                if writable:
                    self._lines = LineFile(path)
                dropped = self._read_index() or (self._lines.dropped if self._lines else 0)
        except BaseException:
            self.close()
            raise
        if dropped:
            notice(f"{path}: dropped a half-written last line ({dropped} bytes)")

    def __enter__(self) -> CallLog:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __len__(self) -> int:
        return len(self._offsets)

    def __contains__(self, key: str) -> bool:
        return key in self._offsets

    def find(self, key: str) -> Reply | None:
        """The recorded reply, or None."""
        if key not in self._offsets:
            return None
        return self._call_at(self._offsets[key]).reply

    def calls(self) -> Iterator[RecordedCall]:
        """All calls in the order of writing, one at a time, with all their messages."""
        conversations = Chains[Message]()
        for offset in list(self._offsets.values()):
            try:
                yield _complete(self._call_at(offset), conversations)
            except ValueError as why:  # a key that is there twice
                raise DamagedError(f"{self.path} is damaged: {why}") from None

    def append(self, call: RecordedCall) -> None:
        """Write one line; it is kept even if this process is killed.

        Raises:
            RunError: The line could not be written; a partial line is removed.
        """
        assert self._lines is not None, "the call log is read-only"
        short = call
        if call.request.tools:
            after, shared = self._conversations.longest(call.request.messages)
            new = call.request.messages[shared:]
            request = call.request.model_copy(update={"messages": new})
            short = call.model_copy(update={"request": request, "after": after, "shared": shared})
        offset = self._lines.append(short.model_dump_json().encode())
        self._offsets.setdefault(call.key, offset)
        _complete(short, self._conversations)

    def close(self) -> None:
        """Close the file, if it is open."""
        if self._lines is not None:
            self._lines.close()

    def _call_at(self, offset: int) -> RecordedCall:
        with self.path.open("rb") as file:
            file.seek(offset)
            return RecordedCall.model_validate_json(file.readline())

    def _read_index(self) -> int:
        """Note where each line begins; the size of a half-written last line in bytes."""
        end = 0

        def key_and_size(line: bytes) -> tuple[str, int]:
            call = RecordedCall.model_validate_json(line)
            return _complete(call, self._conversations).key, len(line)

        for key, size in read_lines(self.path, key_and_size, _damaged):
            self._offsets.setdefault(key, end)
            end += size
        return self.path.stat().st_size - end


def _complete(call: RecordedCall, conversations: Chains[Message]) -> RecordedCall:
    """A call with all its messages; conversations with tools may be continued by later calls.

    Raises:
        ValueError: It continues no call before it.
    """
    if call.after:
        messages = conversations.whole(call.after, call.shared, call.request.messages)
        request = call.request.model_copy(update={"messages": messages})
        call = call.model_copy(update={"request": request, "after": "", "shared": 0})
    if call.request.tools:
        conversations.add(call.key, call.conversation)
    return call


def _damaged(file: Path, number: int, why: ValueError) -> DamagedError:
    where = locate_fault(why, "not JSON")[0] if isinstance(why, ValidationError) else str(why)
    return DamagedError(f"{file}, line {number} is damaged ({where})")


_EXCERPT_CHARS = 30


class RecordingClient(ClientWrapper):
    """Answers from the call log if possible; otherwise asks the inner client and records its reply.

    Several clients may share one call log; the caller closes it.
    """

    def __init__(self, inner: Client, call_log: CallLog) -> None:
        super().__init__(inner)
        self._call_log = call_log
        self._locks: dict[str, asyncio.Lock] = {}

    def holds(self, request: Request) -> bool:
        """Whether the call log already has the reply."""
        return key_of(self.name, request) in self._call_log

    async def complete(self, request: Request) -> Reply:
        """Answer one request; see `Client`.

        Raises:
            RunError: The call log cannot be written.
        """
        key = key_of(self.name, request)
        try:
            async with self._locks.setdefault(key, asyncio.Lock()):
                reply = self._call_log.find(key)
                if reply is None:
                    reply = await self._inner.complete(request)
                    call = RecordedCall(key=key, model=self.name, request=request, reply=reply)
                    self._call_log.append(call)
                return reply
        finally:
            self._locks.pop(key, None)


class ReplayClient:
    """Answers from the call log only.

    Args:
        call_log: The record.
        model: Name of the model in the recorded run.
        budget_spent: Whether the recorded run stopped at its budget; replay then stops at the first
            call that is missing from the call log.
    """

    def __init__(self, call_log: CallLog, model: str, *, budget_spent: bool = False) -> None:
        self._call_log = call_log
        self.name = model
        self._budget_spent = budget_spent

    async def complete(self, request: Request) -> Reply:
        """Answer one request.

        Raises:
            ReplayMissError: It is not in the call log.
            BudgetSpentError: It is not in the call log, and the run stopped at its budget.
        """
        reply = self._call_log.find(key_of(self.name, request))
        if reply is None and self._budget_spent:
            raise BudgetSpentError("the recorded run ended here")
        if reply is None:
            raise ReplayMissError(_explain_miss(self._call_log, self.name, request))
        return reply

    async def aclose(self) -> None:
        """Nothing to release; the call log stays open."""


def _explain_miss(call_log: CallLog, model: str, request: Request) -> str:
    """The nearest recorded request and the first field that differs."""
    requested = _fields(model, request)

    def likeness(call: RecordedCall) -> tuple[bool, float, int]:
        known = _fields(call.model, call.request)
        label, role = call.request.label, call.request.role
        return (
            label == request.label,
            (role == request.role) + SequenceMatcher(None, label, request.label).ratio(),
            sum(known.get(name) == value for name, value in requested.items()),
        )

    nearest = max(call_log.calls(), key=likeness, default=None)
    miss = f"{call_log.path} does not contain the call {request.label!r}"
    if nearest is None:
        return f"{miss}; it contains no calls"
    difference = _first_difference(_fields(nearest.model, nearest.request), requested)
    return f"{miss}; nearest is {nearest.request.label!r}, first difference: {difference}"


def _fields(model: str, request: Request) -> dict[str, str]:
    """A request's fields by path, those whose difference says most first."""
    fields = {"label": request.label, "role": request.role, "model": model}
    for name, value in request.sampling.model_dump().items():
        fields[f"sampling.{name}"] = str(value)
    for index, message in enumerate(request.messages):
        fields[f"messages[{index}].role"] = message.role
        fields[f"messages[{index}].text"] = message.text
        fields[f"messages[{index}].images"] = " ".join(message.images)
        for number, call in enumerate(message.tool_calls):
            fields[f"messages[{index}].tool_calls[{number}]"] = call.model_dump_json()
        fields[f"messages[{index}].tool_call_id"] = message.tool_call_id
    for tool in request.tools:
        fields[f"tools.{tool.name}"] = tool.model_dump_json()
    fields["tool_choice"] = str(request.tool_choice)
    return fields


def _first_difference(recorded: dict[str, str], requested: dict[str, str]) -> str:
    for name in {**recorded, **requested}:
        old, new = recorded.get(name), requested.get(name)
        if old == new:
            continue
        if old is None or new is None:
            return f"{name} is {'missing' if old is None else 'only'} in the record"
        same = takewhile(lambda pair: pair[0] == pair[1], zip(old, new, strict=False))
        at = len(list(same))
        start = max(0, at - _EXCERPT_CHARS // 2)
        excerpts = [repr(text[start : start + _EXCERPT_CHARS]) for text in (old, new)]
        return f"{name} at character {at}: recorded {excerpts[0]}, requested {excerpts[1]}"
    return "none"
