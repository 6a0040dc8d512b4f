"""Bounds the output of a program: its beginning and its end are kept."""

from __future__ import annotations

from collections.abc import Callable

HEAD = 1 << 20
"""Bytes kept of the beginning."""
TAIL = 1 << 16
"""Bytes kept of the end."""


class BoundedOutput:
    """Writes the beginning of an output as it comes, and the end of a long one when it closes."""

    def __init__(self, write: Callable[[bytes], None]) -> None:
        self._write = write
        self._room = HEAD
        self._tail = b""
        self._left_out = 0

    def add(self, chunk: bytes) -> None:
        """Take in the next bytes."""
        head = chunk[: self._room]
        if head:
            self._write(head)
            self._room -= len(head)
        rest = self._tail + chunk[len(head) :]
        self._tail = rest[-TAIL:]
        self._left_out += len(rest) - len(self._tail)

    def close(self) -> None:
        """Write the end of an output that did not fit, and how much is missing before it."""
        if self._left_out:
            self._write(f"\n[{self._left_out:,} bytes of output left out here]\n".encode())
        if self._tail:
            self._write(self._tail)
        self._tail = b""
