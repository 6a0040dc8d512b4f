"""What the model client costs: many calls at once against a slow server on 127.0.0.1.

    python benchmarks/client.py [--calls 10000] [--repeats 9] [--profile]

Prints, for whole and for streamed answers, the wall time of 64 calls at once, each over a
connection of its own that has yet to be opened, against a server that takes one second, as a ratio
to the ideal: 64 bare sockets that connect, send as many bytes and read the answer unparsed, from
the same server. Both take turns, and the fastest of each counts, because whatever else the machine
does can only add to them; medians are printed beside them. The last of three columns is httpx
alone, new connections included: the floor of any client that is built on it.
Then, over many calls to a server that answers at once, the processor time of this process per call
(request, connection, reply, record) and what its memory grows by. Prompts are of the size that
roles send. Exits with 1 when a bound is exceeded.
"""

from __future__ import annotations

import argparse
import asyncio
import cProfile
import json
import pstats
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import httpx

from agentflow.llm.build import open_client
from agentflow.llm.client import Client
from agentflow.llm.endpoint.address import Endpoint
from agentflow.llm.messages import Message, Request
from agentflow.llm.wrappers.budget import Budget
from agentflow.llm.wrappers.tape import Tape

AT_ONCE = 64
LONGEST = 1.1
"""Largest wall time of 64 calls at once, in times of bare sockets."""
COSTLIEST_MS = 3.0
"""Most processor time per call."""
GROWTH_MB = 16.0
"""Most growth of memory from one tenth of the calls to all of them."""
PROMPT = "Blocks are attached to faces of earlier blocks; motors turn about z. " * 120
ANSWER = '{"type": 15, "id": 3, "parent": 2, "face_id": 1}, ' * 40
CHUNKS = 40


def served(latency_s: float, streamed: bool) -> None:
    """Serve until killed; prints the port first. Reads requests just enough to find their end."""
    head = b"HTTP/1.1 200 OK\r\nContent-Type: %b\r\nContent-Length: %d\r\n\r\n"
    usage = {"prompt_tokens": 4000, "completion_tokens": 700}
    if streamed:
        size = len(ANSWER) // CHUNKS
        parts = [ANSWER[at : at + size] for at in range(0, len(ANSWER), size)]
        events = [{"choices": [{"delta": {"content": part}}]} for part in parts]
        events.append({"choices": [{"delta": {}, "finish_reason": "stop"}], "usage": usage})
        lines = [f"data: {json.dumps(event)}\n\n".encode() for event in events]
        lines.append(b"data: [DONE]\n\n")
        kind = b"text/event-stream"
    else:
        choice = {"message": {"content": ANSWER}, "finish_reason": "stop"}
        lines = [json.dumps({"choices": [choice], "usage": usage}).encode()]
        kind = b"application/json"
    start = head % (kind, sum(map(len, lines)))

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            while True:
                asked = (await reader.readuntil(b"\r\n\r\n")).lower()
                size = asked.partition(b"content-length: ")[2].partition(b"\r\n")[0]
                await reader.readexactly(int(size))
                await asyncio.sleep(latency_s)
                writer.write(start)
                for line in lines:
                    writer.write(line)
                    await writer.drain()
        except (asyncio.IncompleteReadError, ConnectionError):
            writer.close()

    async def forever() -> None:
        server = await asyncio.start_server(serve, "127.0.0.1", 0, backlog=4 * AT_ONCE)
        print(server.sockets[0].getsockname()[1], flush=True)
        await server.serve_forever()

    asyncio.run(forever())


@contextmanager
def server(latency_s: float, streamed: bool) -> Iterator[str]:
    """A server in a process of its own; its base URL."""
    command = [sys.executable, __file__, "--serve", str(latency_s)]
    command += ["--streamed"] if streamed else []
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            yield f"http://127.0.0.1:{int(process.stdout.readline())}/v1"
        finally:
            process.kill()


async def ask(client: Client, first: int, count: int) -> None:
    """That many calls, 64 at once."""
    numbers = iter(range(first, first + count))

    async def worker() -> None:
        for number in numbers:
            messages = (Message(role="system", text=PROMPT), Message(role="user", text=PROMPT))
            await client.complete(
                Request(role="designer", label=f"designer/{number}", messages=messages)
            )

    await asyncio.gather(*[worker() for _ in range(AT_ONCE)])


@contextmanager
def opened(base_url: str) -> Iterator[Client]:
    """The whole client, with a record on disk."""
    with (
        tempfile.TemporaryDirectory() as folder,
        Tape(Path(folder) / "calls.jsonl", print) as tape,
    ):
        yield open_client(
            Endpoint("m", base_url, "sk-benchmark"),
            tape=tape,
            budget=Budget(),
            warn=print,
        )


async def wall(base_url: str) -> float:
    """Seconds for 64 calls at once, connections included."""
    with opened(base_url) as client:
        began = time.perf_counter()
        await ask(client, 0, AT_ONCE)
        seconds = time.perf_counter() - began
        await client.aclose()
    return seconds


async def ideal(port: int) -> float:
    """Seconds for the same exchanges over bare sockets."""
    content = b"x" * (2 * len(PROMPT) + 300)
    sent = b"POST / HTTP/1.1\r\nContent-Length: %d\r\n\r\n%b" % (len(content), content)

    async def exchange() -> None:
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(sent)
        head = (await reader.readuntil(b"\r\n\r\n")).lower()
        await reader.readexactly(int(head.partition(b"content-length: ")[2].split()[0]))
        writer.close()

    began = time.perf_counter()
    await asyncio.gather(*[exchange() for _ in range(AT_ONCE)])
    return time.perf_counter() - began


async def bare_httpx(base_url: str) -> float:
    """Seconds for the same exchanges by httpx, a client for each, answers unparsed."""
    texts = [{"role": role, "content": PROMPT} for role in ("system", "user")]
    certificates = httpx.create_ssl_context()

    async def exchange() -> None:
        async with httpx.AsyncClient(verify=certificates, trust_env=False, timeout=60) as http:
            await http.post(f"{base_url}/chat/completions", json={"model": "m", "messages": texts})

    began = time.perf_counter()
    await asyncio.gather(*[exchange() for _ in range(AT_ONCE)])
    return time.perf_counter() - began


async def cost(base_url: str, calls: int, profile: cProfile.Profile | None) -> tuple[float, float]:
    """Processor milliseconds per call, and megabytes that the last nine tenths of them add."""
    with opened(base_url) as client:
        await ask(client, 0, calls // 10)
        memory, began = resident_mb(), time.process_time()
        if profile:
            profile.enable()
        await ask(client, calls // 10, calls - calls // 10)
        if profile:
            profile.disable()
        spent = time.process_time() - began
        grown = resident_mb() - memory
        await client.aclose()
    return 1000 * spent / (calls - calls // 10), grown


def resident_mb() -> float:
    """Memory of this process now (Linux), else its peak so far."""
    status = Path("/proc/self/statm")
    if status.exists():
        return int(status.read_text().split()[1]) * resource.getpagesize() / 2**20
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**10


def main() -> int:
    """Measure and print; 1 when a bound is exceeded."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--calls", type=int, default=10_000)
    parser.add_argument("--repeats", type=int, default=9)
    parser.add_argument("--profile", action="store_true", help="show where the time goes")
    parser.add_argument("--serve", type=float, help=argparse.SUPPRESS)
    parser.add_argument("--streamed", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.serve is not None:
        served(options.serve, options.streamed)
    kept = True
    for streamed in (False, True):
        answers = f"streamed in {CHUNKS} chunks" if streamed else "whole"
        with server(1.0, streamed) as url:
            port = int(url.split(":")[2].split("/")[0])
            rows = [
                (asyncio.run(wall(url)), asyncio.run(ideal(port)), asyncio.run(bare_httpx(url)))
                for _ in range(options.repeats)
            ]
        columns = list(zip(*rows, strict=True))
        (ours, bare, floor), medians = map(min, columns), map(statistics.median, columns)
        ratio = ours / bare
        profile = cProfile.Profile() if options.profile else None
        with server(0.0, streamed) as url:
            spent, grown = asyncio.run(cost(url, options.calls, profile))
        print(
            f"{answers}: {AT_ONCE} calls at once take {ours:.3f} s, {ratio:.3f} times the ideal "
            f"of {bare:.3f} s; httpx alone {floor:.3f} s "
            f"(medians of {options.repeats}: {', '.join(f'{m:.3f}' for m in medians)})\n"
            f"  {spent:.2f} ms of processor per call, {grown:+.1f} MB over {options.calls} calls"
        )
        if profile:
            pstats.Stats(profile).sort_stats("tottime").print_stats(15)
        kept &= ratio <= LONGEST and spent <= COSTLIEST_MS and grown <= GROWTH_MB
    return 0 if kept else 1


if __name__ == "__main__":
    sys.exit(main())
