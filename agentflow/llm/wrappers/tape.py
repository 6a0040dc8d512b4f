"""The record of a run's calls, `calls.jsonl`: one line per call, looked up by key."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ValidationError

from agentflow.errors import RunError
from agentflow.files import LineFile, is_whole
from agentflow.llm.messages import Reply, Request


class RecordedCall(BaseModel, frozen=True, extra="forbid"):
    """One line of the tape. Prompts and replies only: no base URL, no key, no timeouts."""

    schema_version: Literal[1] = 1
    key: str
    model: str
    """Name of the model in the configuration."""
    request: Request
    reply: Reply


def key_of(model: str, request: Request) -> str:
    """Hash of the label and of everything that affects the reply."""
    content = {"model": model, "request": request.model_dump(mode="json")}
    text = json.dumps(content, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


class Tape:
    """A record of calls on disk; only the offset of each line is held in memory.

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
        self._lines: LineFile | None = None
        try:
            if writable:
                self._lines = LineFile(path)
            dropped = self._read_index() or (self._lines.dropped if self._lines else 0)
        except OSError as problem:
            raise RunError(f"cannot open {path}: {problem.strerror}") from None
        except BaseException:
            self.close()
            raise
        if dropped:
            notice(f"{path}: dropped a half-written last line ({dropped} bytes)")

    def __enter__(self) -> Tape:
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
        """All calls in the order of writing, one at a time."""
        for offset in list(self._offsets.values()):
            yield self._call_at(offset)

    def append(self, call: RecordedCall) -> None:
        """Write one line; it is kept even if this process is killed.

        Raises:
            RunError: The line could not be written; a partial line is removed.
        """
        assert self._lines is not None, "the tape is read-only"
        try:
            offset = self._lines.append(call.model_dump_json().encode())
        except OSError as problem:
            raise RunError(f"cannot write {self.path}: {problem.strerror}") from None
        self._offsets.setdefault(call.key, offset)

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
        with self.path.open("rb") as file:
            for number, line in enumerate(file, start=1):
                if not is_whole(line):
                    return len(line)
                self._offsets.setdefault(self._key_in(line, number), end)
                end += len(line)
        return 0

    def _key_in(self, line: bytes, number: int) -> str:
        try:
            return RecordedCall.model_validate_json(line).key
        except ValidationError as problem:
            where = ".".join(str(part) for part in problem.errors()[0]["loc"])
            raise RunError(
                f"{self.path}, line {number} is damaged ({where or 'not JSON'})"
            ) from None
