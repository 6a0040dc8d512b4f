"""An endpoint that misbehaves on demand, in the test's event loop on 127.0.0.1."""

from __future__ import annotations

import asyncio
import json
import socket
import ssl
import struct
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from typing import Any

Answer = Callable[[asyncio.StreamWriter], Awaitable[None]]


@dataclass(frozen=True)
class Asked:
    """One received request."""

    target: str
    headers: Mapping[str, str]
    body: dict[str, Any]


@dataclass
class Server:
    """Gives the answers in order and repeats the last one."""

    answers: list[Answer]
    base_url: str = ""
    asked: list[Asked] = field(default_factory=list)
    connections: int = 0
    tasks: set[asyncio.Task[None]] = field(default_factory=set)

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        self.tasks.add(task)
        self.connections += 1
        try:
            while head := await _head(reader):
                target, headers = head
                body = await reader.readexactly(int(headers["content-length"]))
                self.asked.append(Asked(target, headers, json.loads(body)))
                answer = self.answers[min(len(self.asked), len(self.answers)) - 1]
                await answer(writer)
                if writer.is_closing():
                    break
        except (ConnectionError, asyncio.CancelledError):
            pass
        finally:
            self.tasks.discard(task)
            writer.close()


async def _head(reader: asyncio.StreamReader) -> tuple[str, dict[str, str]] | None:
    try:
        text = (await reader.readuntil(b"\r\n\r\n")).decode()
    except asyncio.IncompleteReadError:
        return None
    first, *lines = text.strip().split("\r\n")
    headers = {k.lower(): v for k, v in (line.split(": ", 1) for line in lines)}
    return first.split(" ")[1], headers


@asynccontextmanager
async def serving(*answers: Answer, tls: ssl.SSLContext | None = None) -> AsyncIterator[Server]:
    """A server with these answers; its base URL ends in /v1."""
    server = Server(list(answers))
    listener = await asyncio.start_server(server.serve, "127.0.0.1", 0, ssl=tls)
    scheme = "https" if tls else "http"
    server.base_url = f"{scheme}://127.0.0.1:{listener.sockets[0].getsockname()[1]}/v1"
    try:
        yield server
    finally:
        listener.close()
        for task in list(server.tasks):
            task.cancel()
        await asyncio.gather(*server.tasks, return_exceptions=True)
        await listener.wait_closed()  # from Python 3.12 on, it waits for all connections


def raw(*parts: bytes, pause_s: float = 0.0, close: bool = False) -> Answer:
    """Sends these bytes with pauses between them."""

    async def answer(writer: asyncio.StreamWriter) -> None:
        for part in parts:
            writer.write(part)
            await writer.drain()
            await asyncio.sleep(pause_s)
        if close:
            writer.close()

    return answer


def body(
    content: object, status: int = 200, kind: str = "application/json", **headers: str
) -> Answer:
    """A whole answer: text as it is, anything else as JSON."""
    data = (content if isinstance(content, str) else json.dumps(content)).encode()
    lines = [f"HTTP/1.1 {status} X", f"Content-Type: {kind}", f"Content-Length: {len(data)}"]
    lines += [f"{name.replace('_', '-')}: {value}" for name, value in headers.items()]
    return raw("\r\n".join(lines).encode() + b"\r\n\r\n" + data)


def completion(text: str | None, finish: str = "stop", **message: object) -> dict[str, object]:
    """A chat completion object."""
    return {
        "object": "chat.completion",
        "model": "model-as-answered",
        "choices": [
            {"message": {"role": "assistant", "content": text, **message}, "finish_reason": finish}
        ],
        "usage": {
            "prompt_tokens": 11,
            "completion_tokens": 7,
            "completion_tokens_details": {"reasoning_tokens": 3},
            "prompt_tokens_details": {"cached_tokens": 5},
        },
    }


def reply(text: str | None, finish: str = "stop", **message: object) -> Answer:
    """A chat completion from a server that does not stream."""
    return body(completion(text, finish, **message))


def chunk(finish: str | None = None, **delta: object) -> dict[str, object]:
    """One chunk of a stream."""
    return {"model": "model-as-answered", "choices": [{"delta": delta, "finish_reason": finish}]}


def stream(*chunks: object, done: bool = True, pause_s: float = 0.0, close: bool = False) -> Answer:
    """A chunked event stream; without `done` it just stops, and `close` cuts it off."""
    events = [f"data: {json.dumps(item)}\r\n\r\n".encode() for item in chunks]
    if done:
        events.append(b"data: [DONE]\n\n")
    head = (
        b"HTTP/1.1 200 OK\r\nContent-Type: text/event-stream\r\nTransfer-Encoding: chunked\r\n\r\n"
    )
    parts = [b"%x\r\n%b\r\n" % (len(event), event) for event in events]
    end = [] if close else [b"0\r\n\r\n"]
    return raw(head, *parts, *end, pause_s=pause_s, close=close)


async def silence(_writer: asyncio.StreamWriter) -> None:
    """No answer at all."""
    await asyncio.sleep(3600)


async def hang_up(writer: asyncio.StreamWriter) -> None:
    """The connection dropped before the headers."""
    writer.close()


async def reset(writer: asyncio.StreamWriter) -> None:
    """The connection reset, after some data, while the answer is read."""
    writer.write(b"HTTP/1.1 200 OK\r\nContent-Length: 900\r\n\r\n{")
    await writer.drain()
    await asyncio.sleep(0.1)
    linger = struct.pack("ii", 1, 0)
    writer.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, linger)
    writer.transport.abort()
