"""Owns the framing of an answer's bytes: server-sent events or one whole body. Reads no JSON."""

from __future__ import annotations

_FIELDS = (b"data:", b"event:", b"id:", b"retry:", b":")


class Framing:
    """Cuts an answer into the data of its events, chunk by chunk.

    The first line that is not blank decides whether the answer is a stream of events or one body,
    because not every server labels its answers rightly. Lines end at line feeds only: JSON strings
    may hold U+2028 and other characters that `splitlines` takes for line ends.
    """

    def __init__(self) -> None:
        self.streamed: bool | None = None
        """Whether these are events; None before anything has come."""
        self._line: list[bytes] = []
        self._data: list[bytes] = []
        self._body: list[bytes] = []

    def feed(self, chunk: bytes) -> list[bytes]:
        """Take in bytes.

        Returns:
            The data of the events that they complete; empty for a body that is no event stream.
        """
        head, *rest = chunk.split(b"\n")
        self._line.append(head)
        events = []
        for part in rest:
            events += self._end_line()
            self._line.append(part)
        return events

    def end(self) -> list[bytes]:
        """The data of an event without an end, or the whole body (also an empty one)."""
        events = self._end_line()
        if self.streamed:
            return events + self._end_line()
        return [b"\n".join(self._body)]

    def _end_line(self) -> list[bytes]:
        line = b"".join(self._line).removesuffix(b"\r")
        self._line.clear()
        if self.streamed is None and line.strip():
            self.streamed = line.startswith(_FIELDS)
        if not self.streamed:
            self._body.append(line)
        elif line.startswith(b"data:"):
            self._data.append(line[5:].removeprefix(b" "))
        elif not line and self._data:
            event = b"\n".join(self._data)
            self._data.clear()
            return [event]
        return []
