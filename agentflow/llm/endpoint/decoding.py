"""Decompress answers in bounded pieces: a few kilobytes can hold gigabytes, or cost hours."""

from __future__ import annotations

import asyncio
import zlib
from collections.abc import AsyncIterator

import httpx

ACCEPTED = "gzip, deflate"
"""What requests offer as Accept-Encoding."""
_KNOWN = ("gzip", "x-gzip", "deflate")
_PIECE_BYTES = 2**16
_GZIP_OR_ZLIB = 32 + zlib.MAX_WBITS


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
