"""An agent program for the workflow `external`: it builds a cart and improves it with the tools.

It runs in the folder of a stage, where `.mcp.json` says how to reach the tools. It is not a
language model: it tries the changes of a list, and keeps those that score higher.
"""

import asyncio
import json
from pathlib import Path
from typing import Any

import httpx2
from mcp import Client
from mcp.client.streamable_http import streamable_http_client

CART = [
    {"type": 0, "id": 0, "parent": -1, "face_id": -1},
    {"type": 1, "id": 1, "parent": 0, "face_id": 0},
    {"type": 1, "id": 2, "parent": 0, "face_id": 1},
    {"type": 2, "id": 3, "parent": 1, "face_id": 1},
    {"type": 2, "id": 4, "parent": 1, "face_id": 3},
]
"""Two powered wheels in front; the rear drags."""
CHANGES = ["Add 35 to 0 in 4", "Add 2 to 2 in 1\nAdd 2 to 2 in 3", "Add 15 to 1 in 0"]


async def main() -> None:
    server = json.loads(Path(".mcp.json").read_text())["mcpServers"]["agentflow"]
    headers, patience = server["headers"], httpx2.Timeout(600)
    async with (
        httpx2.AsyncClient(headers=headers, timeout=patience) as http,
        Client(streamable_http_client(server["url"], http_client=http)) as client,
    ):
        await design(client)


async def design(client: Client) -> None:
    """Work through one stage."""
    tools = {tool.name for tool in (await client.list_tools()).tools}
    best = (await use(client, "check", machine=json.dumps(CART)))["machine"]
    good = [best]
    for change in CHANGES:
        edited = (await use(client, "edit", machine=best, script=change)).get("machine")
        if edited and ("simulate" not in tools or await is_better(client, edited, best)):
            best = edited
            good.append(best)
    for name in good[-2:]:
        await use(client, "submit", machine=name)


async def is_better(client: Client, machine: str, than: str) -> bool:
    scores = [(await use(client, "simulate", machine=name))["score"] for name in (machine, than)]
    return None not in scores and scores[0] > scores[1]


async def use(client: Client, tool: str, **arguments: str) -> dict[str, Any]:
    """Call a tool; the answer as data, which has no `machine` if the call was refused."""
    result = await client.call_tool(tool, arguments)
    print(tool, *(text.text for text in result.content if text.type == "text"), flush=True)
    return result.structured_content or {}


asyncio.run(main())
