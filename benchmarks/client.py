"""Measures the overhead of the model client: concurrent calls to a slow server on 127.0.0.1.

    python benchmarks/client.py [--calls 10000] [--repeats 9] [--profile]

For whole and for streamed replies, prints the wall time of 64 concurrent calls, each over a new
connection, to a server that takes one second, and its ratio to the ideal: 64 bare sockets that
connect to the same server, send as many bytes and read the reply unparsed. The two are measured in
turns and the fastest of each counts, because other load only adds time; medians are printed too.
The third column is httpx alone, new connections included: the minimum for a client built on it.
Then, over many calls to a server that replies immediately, it prints the CPU time per call
(request, connection, reply, record) and the growth of memory. Prompts are as long as those of the
roles. The exit status is 1 if a limit is exceeded.
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

from agentflow.llm.build import open_client, wrap
from agentflow.llm.endpoint.body import Endpoint
from agentflow.llm.messages import Client, Message, Request
from agentflow.llm.wrappers.budget import Budget
from agentflow.llm.wrappers.record import CallLog

AT_ONCE = 64
MAX_RATIO = 1.1
"""Limit of the wall time of 64 concurrent calls, relative to bare sockets."""
MAX_CPU_MS = 3.0
"""Limit of the CPU time per call."""
MAX_GROWTH_MB = 16.0
"""Limit of the growth of memory between one tenth of the calls and all of them."""
PROMPT = "Blocks are attached to faces of earlier blocks; motors turn about z. " * 120
ANSWER = '{"type": 15, "id": 3, "parent": 2, "face_id": 1}, ' * 40
CHUNKS = 40


def serve(latency_s: float, streamed: bool) -> None:
    """Print the port, then serve until killed; of requests, only the length is read."""
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

    async def answer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            while True:
                request = (await reader.readuntil(b"\r\n\r\n")).lower()
                size = request.partition(b"content-length: ")[2].partition(b"\r\n")[0]
                await reader.readexactly(int(size))
                await asyncio.sleep(latency_s)
                writer.write(start)
                for line in lines:
                    writer.write(line)
                    await writer.drain()
        except (asyncio.IncompleteReadError, ConnectionError):
            writer.close()

    async def forever() -> None:
        server = await asyncio.start_server(answer, "127.0.0.1", 0, backlog=4 * AT_ONCE)
        print(server.sockets[0].getsockname()[1], flush=True)
        await server.serve_forever()

    asyncio.run(forever())


@contextmanager
def server(latency_s: float, streamed: bool) -> Iterator[str]:
    """Run a server in a separate process and yield its base URL."""
    command = [sys.executable, __file__, "--serve", str(latency_s)]
    command += ["--streamed"] if streamed else []
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            yield f"http://127.0.0.1:{int(process.stdout.readline())}/v1"
        finally:
            process.kill()


async def ask(client: Client, first: int, count: int) -> None:
    """Make `count` calls, 64 at a time."""
    numbers = iter(range(first, first + count))

    async def worker() -> None:
        for number in numbers:
            messages = (Message(role="system", text=PROMPT), Message(role="user", text=PROMPT))
            await client.complete(
                Request(role="designer", label=f"designer/{number}", messages=messages)
            )

    await asyncio.gather(*[worker() for _ in range(AT_ONCE)])


@contextmanager
def open_recorded(base_url: str) -> Iterator[Client]:
    """The complete client, recording to disk."""
    with (
        tempfile.TemporaryDirectory() as folder,
        CallLog(Path(folder) / "calls.jsonl", print) as call_log,
    ):
        reached = open_client(Endpoint("m", base_url, "sk-benchmark"), warn=print)
        yield wrap(reached, call_log=call_log, budget=Budget())


async def wall(base_url: str) -> float:
    """Seconds for 64 concurrent calls, connections included."""
    with open_recorded(base_url) as client:
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
    """Seconds for the same exchanges with httpx, one client each, replies unparsed."""
    texts = [{"role": role, "content": PROMPT} for role in ("system", "user")]
    certificates = httpx.create_ssl_context()

    async def exchange() -> None:
        async with httpx.AsyncClient(verify=certificates, trust_env=False, timeout=60) as http:
            await http.post(f"{base_url}/chat/completions", json={"model": "m", "messages": texts})

    began = time.perf_counter()
    await asyncio.gather(*[exchange() for _ in range(AT_ONCE)])
    return time.perf_counter() - began


async def cost(base_url: str, calls: int, profile: cProfile.Profile | None) -> tuple[float, float]:
    """CPU milliseconds per call, and growth of memory over the last nine tenths of them, MB."""
    with open_recorded(base_url) as client:
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
    """Current memory of this process (on Linux; elsewhere its peak), MB."""
    status = Path("/proc/self/statm")
    if status.exists():
        return int(status.read_text().split()[1]) * resource.getpagesize() / 2**20
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**10


def main() -> int:
    """Measure and print; return 1 if a limit is exceeded."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--calls", type=int, default=10_000)
    parser.add_argument("--repeats", type=int, default=9)
    parser.add_argument("--profile", action="store_true", help="print a profile")
    parser.add_argument("--serve", type=float, help=argparse.SUPPRESS)
    parser.add_argument("--streamed", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.serve is not None:
        serve(options.serve, options.streamed)
    within = True
    for streamed in (False, True):
        replies = f"streamed in {CHUNKS} chunks" if streamed else "whole"
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
            f"{replies}: {AT_ONCE} concurrent calls take {ours:.3f} s, {ratio:.3f} times the ideal "
            f"of {bare:.3f} s; httpx alone {floor:.3f} s "
            f"(medians of {options.repeats}: {', '.join(f'{m:.3f}' for m in medians)})\n"
            f"  {spent:.2f} ms of CPU time per call, {grown:+.1f} MB over {options.calls} calls"
        )
        if profile:
            pstats.Stats(profile).sort_stats("tottime").print_stats(15)
        within &= ratio <= MAX_RATIO and spent <= MAX_CPU_MS and grown <= MAX_GROWTH_MB
    return 0 if within else 1


if __name__ == "__main__":
    sys.exit(main())
