"""Owns the record of a run's calls, `calls.jsonl`: one line per call, found again by its key.

The clients that write it and answer from it are in record.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from types import TracebackType
from typing import BinaryIO, Literal

from pydantic import BaseModel, ConfigDict, ValidationError

from agentflow.errors import RunError
from agentflow.llm.messages import Reply, Request


class Entry(BaseModel):
    """One line of the tape. Prompts and replies only: no base URL, no key, no timeouts."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    schema_version: Literal[1] = 1
    key: str
    model: str
    """Name of the model that was asked, as configured."""
    request: Request
    reply: Reply


def key_of(model: str, request: Request) -> str:
    """Hash of everything that changes the answer, and of the label (spec 4.1)."""
    content = {"model": model, "request": request.model_dump(mode="json")}
    text = json.dumps(content, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


class Tape:
    """A record of calls on disk; in memory only where each line begins.

    Args:
        path: The file; made when it is missing and `writable`.
        notice: Called with one line of text when a half-written last line is passed over, which
            is dropped when `writable`. One that lacks its line break alone counts.
        writable: Whether lines will be appended.

    Raises:
        RunError: The file cannot be opened, or a line other than the last is damaged.
    """

    def __init__(self, path: Path, notice: Callable[[str], None], *, writable: bool = True) -> None:
        self.path = path
        self._offsets: dict[str, int] = {}
        self._end = 0
        self._missing = b""
        """The line break that the last whole line lacks."""
        try:
            self._file: BinaryIO = open(path, "a+b" if writable else "rb", buffering=0)  # noqa: SIM115
        except OSError as problem:
            raise RunError(f"cannot open {path}: {problem.strerror}") from None
        try:
            self._read_index(notice)
            if writable:
                self._file.truncate(self._end)
                self._end += self._file.write(self._missing)
        except BaseException:
            self._file.close()
            raise

    def __enter__(self) -> Tape:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def __len__(self) -> int:
        return len(self._offsets)

    def __contains__(self, key: str) -> bool:
        return key in self._offsets

    def find(self, key: str) -> Reply | None:
        """The recorded reply, or None."""
        if key not in self._offsets:
            return None
        return self._entry_at(self._offsets[key]).reply

    def entries(self) -> Iterator[Entry]:
        """All entries in the order of writing, one at a time."""
        for offset in list(self._offsets.values()):
            yield self._entry_at(offset)

    def append(self, entry: Entry) -> None:
        """Write one line, so that it survives the death of this process.

        Raises:
            RunError: The line could not be written; what was written of it is taken back.
        """
        line = entry.model_dump_json().encode() + b"\n"
        try:
            written = 0
            while written < len(line):
                written += self._file.write(line[written:])
        except OSError as problem:
            self._take_back()
            raise RunError(f"cannot write {self.path}: {problem.strerror}") from None
        self._offsets.setdefault(entry.key, self._end)
        self._end += len(line)

    def close(self) -> None:
        """Close the file; closing twice does no harm."""
        self._file.close()

    def _take_back(self) -> None:
        try:
            self._file.truncate(self._end)
        except OSError:
            self._file.close()  # nothing may follow half a line

    def _entry_at(self, offset: int) -> Entry:
        with open(self.path, "rb") as file:
            file.seek(offset)
            return Entry.model_validate_json(file.readline())

    def _read_index(self, notice: Callable[[str], None]) -> None:
        with open(self.path, "rb") as file:
            for number, line in enumerate(file, start=1):
                if not line.endswith(b"\n"):
                    if not _is_whole(line):
                        notice(f"{self.path}: dropped a half-written last line ({len(line)} bytes)")
                        return
                    self._missing = b"\n"
                self._offsets.setdefault(self._key_in(line, number), self._end)
                self._end += len(line)

    def _key_in(self, line: bytes, number: int) -> str:
        try:
            return Entry.model_validate_json(line).key
        except ValidationError as problem:
            where = ".".join(str(part) for part in problem.errors()[0]["loc"])
            raise RunError(
                f"{self.path}, line {number} is damaged ({where or 'no JSON'})"
            ) from None


def _is_whole(line: bytes) -> bool:
    """Whether a line is whole but for its line break: no part of an object is one."""
    try:
        return isinstance(json.loads(line), dict)
    except (ValueError, RecursionError):
        return False
