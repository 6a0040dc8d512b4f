"""Reading of answers for any chunking of the bytes."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from agentflow.llm.endpoint.reading import read_answer

STREAM = (
    b": a comment\r\n\r\nevent: x\ndata: one\n\ndata:two\r\ndata: more\r\n\r\n"
    b"id: 3\nretry: 5\n\ndata: \xe2\x80\xa8sep\n\ndata: last"
)
EVENTS = ["one", "two\nmore", "\u2028sep", "last"]
BODY = b' \n{"a":\n 1}\n'


def read(data: bytes, cuts: list[int]) -> tuple[bool, list[str]]:
    """What is read of bytes that come in pieces."""
    edges = [0, *sorted(cut % (len(data) + 1) for cut in cuts), len(data)]

    async def pieces() -> AsyncIterator[bytes]:
        for start, end in pairwise(edges):
            yield data[start:end]

    async def read_all() -> tuple[bool, list[str]]:
        streamed, parts = await read_answer(pieces())
        return streamed, [part async for part in parts]

    return asyncio.run(read_all())


@given(st.lists(st.integers(0, 200), max_size=12))
def test_events_do_not_depend_on_chunk_boundaries(cuts: list[int]) -> None:
    assert read(STREAM, cuts) == (True, EVENTS)


@given(st.lists(st.integers(0, 200), max_size=6))
def test_a_body_that_is_not_a_stream_is_returned_whole(cuts: list[int]) -> None:
    assert read(BODY, cuts) == (False, [BODY.decode().lstrip()])


def test_events_without_data_and_a_byte_order_mark_are_skipped() -> None:
    data = b"\xef\xbb\xbfdata:\n\ndata: one\n\nretry: 5\n\ndata:  \n\ndata: two\n\n"
    assert read(data, []) == (True, ["one", "two"])


def test_bytes_that_are_no_text_are_replaced() -> None:
    assert read(b"data: a\xff\xe2\x80\n\n", [9]) == (True, ["a\ufffd\ufffd"])
    assert read(b"{\xff}", []) == (False, ["{\ufffd}"])


def test_nothing_is_an_empty_body() -> None:
    assert read(b"", []) == (False, [""])


@given(st.binary())
def test_any_bytes_are_read(data: bytes) -> None:
    assert isinstance(read(data, [3])[1], list)
