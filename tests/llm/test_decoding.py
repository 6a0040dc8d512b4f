"""Compressed answers are decoded in bounded memory and within the time-out."""

from __future__ import annotations

import gzip
import json
import os
import subprocess
import sys
import time
import zlib
from pathlib import Path

import pytest

from agentflow.llm.endpoint.faults import TransientFault
from tests.app.test_doctor import threaded
from tests.llm.helpers import once
from tests.llm.hostile import Answer, completion, raw, serving

ROOT = Path(__file__).parents[2]
OKAY = json.dumps(completion("okay")).encode()
GIGABYTES = 7 * 2**30


def encoded(data: bytes, *encodings: str) -> Answer:
    head = f"HTTP/1.1 200 X\r\nContent-Encoding: {', '.join(encodings)}\r\n"
    return raw(f"{head}Content-Length: {len(data)}\r\n\r\n".encode() + data)


HEADER = gzip.compress(b"")[:10]


def repeated(start: bytes, stretch: bytes) -> bytes:
    """Raw deflate data of `start` and 7 GB of the same stretch.

    One compressed stretch is repeated, because compressing 7 GB takes minutes.
    """
    deflate = zlib.compressobj(9, zlib.DEFLATED, -zlib.MAX_WBITS)
    head = deflate.compress(start) + deflate.flush(zlib.Z_FULL_FLUSH)
    part = deflate.compress(stretch) + deflate.flush(zlib.Z_FULL_FLUSH)
    return head + part * (GIGABYTES // len(stretch))


def nested(fill: bytes) -> bytes:
    """Gzip within gzip, a few kilobytes that hold 7 GB of the same byte, without check sum."""
    return gzip.compress(HEADER + repeated(b"", fill * 2**26))


@pytest.mark.parametrize("fill", [b"\0", b"\n", b" "])
@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
@pytest.mark.slow
def test_ten_kilobytes_that_hold_seven_gigabytes(fill: bytes) -> None:
    bomb = nested(fill)
    assert len(bomb) < 30_000
    code = """
import re, resource, sys
from pathlib import Path
resource.setrlimit(resource.RLIMIT_AS, (6 * 2**30,) * 2)
from agentflow.cli import main
status = main(sys.argv[1:])
peak = re.search(r"VmHWM:\\s+(\\d+) kB", Path("/proc/self/status").read_text())
print(peak.group(1), file=sys.stderr)  # ru_maxrss counts the process that started this one as well
sys.exit(status)
"""
    environ = {"PYTHONPATH": os.fspath(ROOT), "PATH": os.environ["PATH"]}
    with threaded(encoded(bomb, "gzip", "gzip")) as server:
        command = ["doctor", "--model", "m", "--base-url", server.base_url]
        done = subprocess.run(
            [sys.executable, "-c", code, *command],
            env=environ,
            capture_output=True,
            text=True,
            check=False,
        )
    error, kilobytes = done.stderr.splitlines()
    assert done.returncode == 4
    assert error.startswith(f"agentflow: {server.base_url} did not return a chat completion (more")
    assert int(kilobytes) * 1024 < 300e6


@pytest.mark.parametrize(
    ("data", "encodings"),
    [
        (OKAY, ["identity"]),
        (gzip.compress(OKAY), ["gzip"]),
        (zlib.compress(OKAY), ["deflate"]),
        (gzip.compress(OKAY[:50]) + gzip.compress(OKAY[50:]), ["GZIP"]),
        (gzip.compress(zlib.compress(OKAY)), ["deflate", "x-gzip"]),
    ],
)
async def test_known_encodings(data: bytes, encodings: list[str]) -> None:
    async with serving(encoded(data, *encodings)) as server:
        assert (await once(server.base_url)).text == "okay"
        assert server.asked[0].headers["accept-encoding"] == "gzip, deflate"


@pytest.mark.parametrize(
    ("data", "encoding", "problem"),
    [
        (OKAY, "br", "unknown Content-Encoding 'br'"),
        (OKAY, "gzip", "damaged gzip data: .*incorrect header check"),
        (gzip.compress(OKAY)[:-30], "gzip", "JSON is incomplete"),
    ],
)
async def test_what_cannot_be_decoded_may_be_retried(
    data: bytes, encoding: str, problem: str
) -> None:
    async with serving(encoded(data, encoding)) as server:
        with pytest.raises(TransientFault, match=problem):
            await once(server.base_url)


@pytest.mark.slow
async def test_the_time_out_also_ends_decoding() -> None:
    """The outer layer holds 7 GB of gzip; the inner layer of that holds nothing."""
    empty = zlib.compressobj(9, zlib.DEFLATED, -zlib.MAX_WBITS).flush(zlib.Z_FULL_FLUSH)
    bomb = HEADER + repeated(HEADER, empty * (2**23 // len(empty)))
    async with serving(encoded(bomb, "gzip", "gzip")) as server:
        started = time.process_time()
        with pytest.raises(TransientFault, match=r"no complete reply within 0\.2 s"):
            await once(server.base_url, total_s=0.2)
        assert time.process_time() - started < 5
