"""Many sessions at once over HTTP: nothing is lost or mixed up, and memory does not grow."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path

import pytest
from mcp import Client

from agentflow.integrations.mcp.serving import Served
from agentflow.runs import read_events, read_result
from tests.integrations.mcp.clients import CAR, data_of, http_client, http_server, text_of

pytestmark = pytest.mark.slow
SESSIONS, LATER = 20, 5


def resident(pid: int) -> float:
    """Memory of a process in MB."""
    fields = Path(f"/proc/{pid}/status").read_text(encoding="utf-8").splitlines()
    (line,) = (item for item in fields if item.startswith("VmRSS:"))
    return int(line.split()[1]) / 1024


def car(number: int) -> str:
    """One of five cars, which have towers of 0 to 4 blocks."""
    steps = json.loads(CAR)
    parent, face = 0, 4
    for _ in range(number % 5):
        steps.append({"type": 15, "id": len(steps), "parent": parent, "face_id": face})
        parent, face = len(steps) - 1, 0
    return json.dumps(steps)


async def design(served: Served, number: int) -> tuple[str, float]:
    """One session; the name and the score of its machine."""
    async with http_client(served.url, served.token, read_timeout_seconds=600) as client:
        name = data_of(await client.call_tool("check", {"machine": car(number)}))["machine"]
        score = data_of(await client.call_tool("simulate", {"machine": name}))["score"]
        rows = data_of(await client.call_tool("history", {}))["machines"]
        assert [row["machine"] for row in rows] == [name]
        await submit(client, name)
        return name, score


async def submit(client: Client, name: str) -> None:
    answer = await client.call_tool("submit", {"machine": name})
    assert not answer.is_error, text_of(answer)


@pytest.mark.timeout(900)
async def test_many_sessions_at_once_with_two_workers(tmp_path: Path) -> None:
    async with http_server(tmp_path, "--set", "workers=2", "--set", "verify=false") as (
        served,
        server,
    ):
        first = await asyncio.gather(*(design(served, number) for number in range(SESSIONS)))
        before = resident(server.pid)
        again = await asyncio.gather(*(design(served, number) for number in range(LATER)))
        assert resident(server.pid) < before + 10
    assert again == first[:LATER]
    assert len(set(first)) == 5
    runs = sorted((tmp_path / "runs").iterdir())
    results = [read_result(run) for run in runs]
    assert len(results) == SESSIONS + LATER
    assert sorted(result.score for result in results) == sorted(score for _, score in first + again)
    assert {result.verified for result in results} == {None}
    for run in runs:
        tools = [event.data["tool"] for event in read_events(run) if event.kind == "tool"]
        assert tools == ["check", "simulate", "history", "submit"]
