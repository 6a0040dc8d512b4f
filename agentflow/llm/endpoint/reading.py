"""Read the body of an answer: decompressed in bounded pieces, as a stream of events or as one text.

A few kilobytes can hold gigabytes, or cost hours.
"""

import asyncio
import zlib
from collections.abc import AsyncGenerator, AsyncIterator
from contextlib import aclosing

import httpx
from httpx_sse import EventSource

ACCEPTED = "gzip, deflate"
"""What requests offer as Accept-Encoding."""
_KNOWN = ("gzip", "x-gzip", "deflate")
_PIECE_BYTES = 2**16
_GZIP_OR_ZLIB = 32 + zlib.MAX_WBITS
_FIELDS = (b"data:", b"event:", b"id:", b"retry:", b":")
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"
_ENOUGH = len(_BYTE_ORDER_MARK + b"retry:")
"""Bytes that show how an answer begins."""
_STREAM = {"Content-Type": "text/event-stream; charset=utf-8"}


class UndecodableError(Exception):
    """A body whose compression is damaged or unknown."""


def decoded_pieces(response: httpx.Response) -> AsyncIterator[bytes]:
    """The body of a response, decompressed, in pieces of at most 64 KiB.

    The event loop gets a turn after every piece, so time-outs also end the decompression.

    Raises:
        UndecodableError: While iterating.
    """
    pieces = response.aiter_raw()
    encodings = response.headers.get("content-encoding", "").lower().split(",")
    for encoding in reversed([name.strip() for name in encodings]):
        if encoding not in ("", "identity"):
            pieces = _inflated(pieces, encoding)
    return pieces


async def _inflated(pieces: AsyncIterator[bytes], encoding: str) -> AsyncIterator[bytes]:
    if encoding not in _KNOWN:
        raise UndecodableError(f"unknown Content-Encoding {encoding!r}")
    inflater = zlib.decompressobj(_GZIP_OR_ZLIB)
    async for data in pieces:
        while data:
            if inflater.eof:  # gzip allows several members in a row
                inflater = zlib.decompressobj(_GZIP_OR_ZLIB)
            try:
                piece = inflater.decompress(data, _PIECE_BYTES)
            except zlib.error as error:
                raise UndecodableError(f"damaged {encoding} data: {error}") from None
            data = inflater.unused_data if inflater.eof else inflater.unconsumed_tail
            await asyncio.sleep(0)
            if piece:
                yield piece


async def read_answer(pieces: AsyncIterator[bytes]) -> tuple[bool, AsyncGenerator[str, None]]:
    """Whether an answer is an event stream; the data of its events, or else its body as one text.

    Its beginning decides, because some servers send the wrong content type.
    """
    start = b""
    async for piece in pieces:
        start = (start + piece).lstrip()
        if len(start) >= _ENOUGH:
            break
    plain = start.removeprefix(_BYTE_ORDER_MARK)
    streamed = plain.startswith(_FIELDS)
    return streamed, _events(plain, pieces) if streamed else _body(start, pieces)


async def _events(start: bytes, rest: AsyncIterator[bytes]) -> AsyncGenerator[str, None]:
    """The data of events; gateways send empty ones to keep the connection alive."""

    async def ended() -> AsyncIterator[bytes]:
        yield start
        async for piece in rest:
            yield piece
        yield b"\n\n"  # the decoder drops an event without its end; some servers forget the last

    # The decoder takes a response: one with the right content type, of bytes that are decompressed.
    response = httpx.Response(200, headers=_STREAM, content=ended())
    async with aclosing(EventSource(response).aiter_sse()) as events:
        async for event in events:
            if event.data.strip():
                yield event.data


async def _body(start: bytes, rest: AsyncIterator[bytes]) -> AsyncGenerator[str, None]:
    whole = [start]
    async for piece in rest:
        whole.append(piece)
    yield b"".join(whole).decode("utf-8", "replace")
