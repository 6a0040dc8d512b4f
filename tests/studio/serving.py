"""A real studio on a loopback port, in a thread, and requests to it."""

from __future__ import annotations

import asyncio
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import httpx

from agentflow.studio.app import running
from agentflow.studio.guard import RequestLimits

PATIENCE = 120.0


@dataclass(frozen=True)
class Served:
    """A studio, and the address that opens it once."""

    address: str
    clients: list[httpx.Client] = field(default_factory=list)
    """Those to close at the end."""

    @property
    def base(self) -> str:
        """Its address without the token."""
        return f"http://{self.host}"

    @property
    def host(self) -> str:
        return urlsplit(self.address).netloc

    @property
    def port(self) -> int:
        return int(urlsplit(self.address).port or 0)

    def enter(self) -> Browser:
        """Use the token up."""
        client = httpx.Client(base_url=self.base, trust_env=False, timeout=PATIENCE)
        self.clients.append(client)
        answer = client.get(self.address)
        assert (answer.status_code, answer.headers["location"]) == (303, "/")
        return Browser(client, self)


@dataclass(frozen=True)
class Browser:
    """What the page of a studio can do."""

    client: httpx.Client
    served: Served

    def get(self, path: str, **query: str) -> Any:
        return self.told(self.client.get(path, params=query))

    def post(self, path: str, data: Any) -> Any:
        return self.told(self.ask(path, data))

    def ask(self, path: str, data: Any, **headers: str) -> httpx.Response:
        return self.client.post(path, json=data, headers={"origin": self.served.base, **headers})

    @staticmethod
    def told(answer: httpx.Response) -> Any:
        assert answer.status_code == 200, answer.text
        return answer.json()

    @property
    def cookie(self) -> str:
        [(name, value)] = self.client.cookies.items()
        return f"{name}={value}"

    def raw(self, head: str, body: bytes = b"", cookie: bool = True) -> bytes:
        """The beginning of the answer to a request as it is on the wire."""
        lines = head.strip().splitlines()
        if cookie:
            lines.append(f"Cookie: {self.cookie}")
        with socket.create_connection(("127.0.0.1", self.served.port), timeout=PATIENCE) as wire:
            wire.sendall("\r\n".join([*lines, "", ""]).encode("latin-1") + body)
            return wire.recv(65536)


@contextmanager
def studio(runs: Path, limits: RequestLimits | None = None) -> Iterator[Served]:
    """Serve a folder of runs while the context is open."""
    ready: dict[str, Any] = {}
    opened = threading.Event()

    async def serve() -> None:
        loop, ended = asyncio.get_running_loop(), asyncio.Event()
        async with running(runs, 0, limits) as address:
            ready.update(address=address, end=lambda: loop.call_soon_threadsafe(ended.set))
            opened.set()
            await ended.wait()

    thread = threading.Thread(target=lambda: asyncio.run(serve()), daemon=True)
    thread.start()
    assert opened.wait(PATIENCE)
    served = Served(ready["address"])
    try:
        yield served
    finally:
        for client in served.clients:
            client.close()
        ready["end"]()
        thread.join(PATIENCE)
        assert not thread.is_alive()
