"""The record of a run's calls, `calls.jsonl`: one line per call, looked up by key."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Literal

from pydantic import NonNegativeInt, ValidationError

from agentflow.errors import DamagedError
from agentflow.files.atomic import os_errors
from agentflow.files.chains import Chains
from agentflow.files.faults import locate_fault
from agentflow.files.lines import LineFile, read_lines
from agentflow.llm.messages import Message, Recorded, Reply, Request


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
