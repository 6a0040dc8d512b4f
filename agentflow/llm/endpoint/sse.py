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
        *whole, rest = chunk.split(b"\n")
        if whole and self._rest:
            whole[0] = b"".join([*self._rest, whole[0]])
            self._rest.clear()
        self._rest.append(rest)
        events = [self._read(line.removesuffix(b"\r")) for line in whole]
        return [event for event in events if event is not None]

    def end(self) -> list[bytes]:
        """End the answer; the data of an unfinished event, or the whole (maybe empty) body."""
        last = self._read(b"".join(self._rest).removesuffix(b"\r"))
        if not self.streamed:
            return [b"\n".join(self._body)]
        return [event for event in (last, self._read(b"")) if event is not None]

    def _read(self, line: bytes) -> bytes | None:
        """Add one line; the data of the event that it ends, if any."""
        if self.streamed is None and line.strip():
            line = line.removeprefix(b"\xef\xbb\xbf")
            self.streamed = line.startswith(_FIELDS)
        if not self.streamed:
            self._body.append(line)
        elif line.startswith(b"data:"):
            self._data.append(line[5:].removeprefix(b" "))
        elif not line and self._data:
            event = b"\n".join(self._data)
            self._data.clear()
            return event if event.strip() else None  # gateways send empty events as keep-alive
        return None
