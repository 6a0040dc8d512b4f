"""Event decoding for any chunking of the bytes."""

from __future__ import annotations

from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from agentflow.llm.endpoint.sse import EventDecoder

STREAM = (
    b": a comment\r\n\r\nevent: x\ndata: one\n\ndata:two\r\ndata: more\r\n\r\n"
    b"id: 3\nretry: 5\n\ndata: \xe2\x80\xa8sep\n\ndata: last"
)
EVENTS = [b"one", b"two\nmore", b"\xe2\x80\xa8sep", b"last"]
BODY = b' \n{"a":\n 1}\n'


def framed(data: bytes, cuts: list[int]) -> tuple[bool | None, list[bytes]]:
    framing = EventDecoder()
    edges = [0, *sorted(cut % (len(data) + 1) for cut in cuts), len(data)]
    found = []
    for start, end in pairwise(edges):
        found += framing.feed(data[start:end])
    return framing.streamed, found + framing.end()


@given(st.lists(st.integers(0, 200), max_size=12))
def test_events_do_not_depend_on_chunk_boundaries(cuts: list[int]) -> None:
    assert framed(STREAM, cuts) == (True, EVENTS)


@given(st.lists(st.integers(0, 200), max_size=6))
def test_a_body_that_is_not_a_stream_is_returned_whole(cuts: list[int]) -> None:
    assert framed(BODY, cuts) == (False, [BODY])


def test_events_without_data_and_a_byte_order_mark_are_skipped() -> None:
    data = b"\xef\xbb\xbfdata:\n\ndata: one\n\nretry: 5\n\ndata:  \n\ndata: two\n\n"
    assert framed(data, []) == (True, [b"one", b"two"])


def test_nothing_is_an_empty_body() -> None:
    assert framed(b"", []) == (None, [b""])


@given(st.binary())
def test_any_bytes_are_framed(data: bytes) -> None:
    assert isinstance(framed(data, [3])[1], list)
