from __future__ import annotations

import asyncio
import socket
from collections.abc import AsyncIterator

import pytest
from starlette.responses import StreamingResponse

from agentflow.errors import UsageError
from agentflow.listening import is_secret, listen, make_token, serving


def test_says_that_a_port_is_in_use_and_what_to_do() -> None:
    with listen("127.0.0.1", 0) as taken:
        port = taken.getsockname()[1]
        for advice in ("", "; choose another --port"):
            with pytest.raises(UsageError) as error:
                listen("127.0.0.1", port, advice)
            why = "Address already in use"
            assert str(error.value) == f"cannot listen on 127.0.0.1:{port}: {why}{advice}"


def test_an_address_that_is_not_of_this_machine_is_refused() -> None:
    with pytest.raises(UsageError, match=r"^cannot listen on 192\.0\.2\.1:0: "):
        listen("192.0.2.1", 0)


@pytest.mark.skipif(not socket.has_ipv6, reason="needs IPv6")
def test_listens_on_addresses_in_brackets() -> None:
    with listen("[::1]", 0) as listening:
        assert listening.family is socket.AF_INET6


def test_a_secret_is_only_itself() -> None:
    token = make_token()
    assert len(token) == 43
    assert is_secret(token, token)
    assert not any(is_secret(given, token) for given in ("", token[:-1], f"{token}x", "\udcff"))


async def stream() -> AsyncIterator[str]:
    while True:
        yield "still here\n"
        await asyncio.sleep(60)


@pytest.mark.slow
async def test_an_open_stream_ends_without_a_traceback(caplog: pytest.LogCaptureFixture) -> None:
    listening = listen("127.0.0.1", 0)
    port = listening.getsockname()[1]
    async with serving(StreamingResponse(stream()), listening):
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(b"GET / HTTP/1.1\r\nHost: x\r\n\r\n")
        await reader.readuntil(b"still here")
    assert [record.getMessage() for record in caplog.records if record.levelname == "ERROR"] == []
    writer.close()


async def test_connections_that_ask_nothing_make_place_for_others() -> None:
    listening = listen("127.0.0.1", 0)
    port = listening.getsockname()[1]
    async with serving(StreamingResponse(iter(["here"])), listening, most=4):
        idle = [await asyncio.open_connection("127.0.0.1", port) for _ in range(6)]
        for _ in range(2):
            reader, writer = await asyncio.open_connection("127.0.0.1", port)
            writer.write(b"GET / HTTP/1.1\r\nHost: x\r\n\r\n")
            assert (await reader.readline()).split()[1] == b"200"
            idle.append((reader, writer))
    for _, writer in idle:
        writer.close()
