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
        self._rest: list[bytes] = []
        self._data: list[bytes] = []
        self._body: list[bytes] = []

    def feed(self, chunk: bytes) -> list[bytes]:
        """Take in bytes.

        Returns:
            The data of the events that they complete; empty for a body that is no event stream.
        """
        *whole, rest = chunk.split(b"\n")
        if whole and self._rest:
            whole[0] = b"".join([*self._rest, whole[0]])
            self._rest.clear()
        self._rest.append(rest)
        events = [self._read(line.removesuffix(b"\r")) for line in whole]
        return [event for event in events if event is not None]

    def end(self) -> list[bytes]:
        """The data of an event without an end, or the whole body (also an empty one)."""
        last = self._read(b"".join(self._rest).removesuffix(b"\r"))
        if not self.streamed:
            return [b"\n".join(self._body)]
        return [event for event in (last, self._read(b"")) if event is not None]

    def _read(self, line: bytes) -> bytes | None:
        """Take in one line; the event that it ends, if it does."""
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
            return event if event.strip() else None  # gateways keep connections alive with these
        return None
