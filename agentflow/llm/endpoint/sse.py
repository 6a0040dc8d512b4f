"""Decode server-sent events, or a body that is not a stream."""

from __future__ import annotations

_FIELDS = (b"data:", b"event:", b"id:", b"retry:", b":")


class EventDecoder:
    """Splits an answer into the data of its events, chunk by chunk.

    The first non-blank line decides whether the answer is an event stream, because some servers
    send the wrong content type. Only line feeds end lines: JSON strings may contain U+2028 and
    other characters that `splitlines` splits at.
    """

    def __init__(self) -> None:
        self.streamed: bool | None = None
        """Whether the answer is an event stream; None before the first line."""
        self._rest: list[bytes] = []
        self._data: list[bytes] = []
        self._body: list[bytes] = []

    def feed(self, chunk: bytes) -> list[bytes]:
        """Add bytes; the data of the events that they complete (none unless streamed)."""
        streamed = self.streamed
        blank = streamed is None and not self._rest and chunk.endswith(b"\n")
        if streamed is False or (blank and not chunk.strip()):
            self._body.append(chunk)  # whole: line by line, a body of line feeds fills the memory
            return []
        *whole, rest = chunk.split(b"\n")
        if whole and self._rest:
            whole[0] = b"".join([*self._rest, whole[0]])
            self._rest.clear()
        events = [event for line in whole if (event := self._read(line)) is not None]
        if self.streamed is False:
            self._body.append(rest)
        elif rest:
            self._rest.append(rest)
        return events

    def end(self) -> list[bytes]:
        """End the answer; the data of an unfinished event, or the whole (maybe empty) body."""
        rest = self._decide(b"".join(self._rest))
        if not self.streamed:
            return [b"".join([*self._body, rest])]
        last = self._read(rest)
        return [event for event in (last, self._read(b"")) if event is not None]

    def _read(self, line: bytes) -> bytes | None:
        """Add one line; the data of the event that it ends, if any."""
        line = self._decide(line)
        if not self.streamed:
            self._body.append(line + b"\n")
            return None
        line = line.removesuffix(b"\r")
        if line.startswith(b"data:"):
            self._data.append(line[5:].removeprefix(b" "))
        elif not line and self._data:
            event = b"\n".join(self._data)
            self._data.clear()
            return event if event.strip() else None  # gateways send empty events as keep-alive
        return None

    def _decide(self, line: bytes) -> bytes:
        """Let the first line that is not blank decide; the line without a byte order mark."""
        if self.streamed is None and line.strip():
            line = line.removeprefix(b"\xef\xbb\xbf")
            self.streamed = line.startswith(_FIELDS)
        return line
