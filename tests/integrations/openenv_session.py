"""Serves OpenEnv on loopback and plays there; runs in `.venv-openenv`.

Usage: python openenv_session.py CAR FOLDER CODE. Runs CODE, prints what clients saw, and what
OpenEnv says of the environment in FOLDER, as JSON; leaves the runs in `runs`.
"""

from __future__ import annotations

import asyncio
import json
import socket
import sys
import time
from pathlib import Path
from threading import Thread
from typing import Any

import uvicorn
from openenv.cli._validation import validate_multi_mode_deployment

from agentflow.integrations.openenv import BenchAction, BenchClient, make_app

SESSIONS = 100
NAME = "6c45a9a7"
"""What the tools call the car."""


async def play(url: str, car: str) -> dict[str, Any]:
    """A design from reset to submission, with what is refused on the way."""
    async with BenchClient(base_url=url) as client:
        try:
            await client.step(BenchAction(tool="brief"))
        except RuntimeError as error:
            early = str(error)
        wrong = []
        for options in ({"task": "walking"}, {"level": 2}):
            try:
                await client.reset(**options)
            except RuntimeError as error:
                wrong.append(str(error))
        first = (await client.reset(task="movement", seed=0)).observation
        checked = await client.step(BenchAction(tool="check", arguments={"machine": car}))
        name = checked.observation.data["machine"]
        refused = (await client.step(BenchAction(tool="fly"))).observation
        done = await client.step(BenchAction(tool="submit", arguments={"machine": name}))
        late = await client.step(BenchAction(tool="submit", arguments={"machine": name}))
        state = await client.state()
    return {
        "early": early,
        "wrong": wrong,
        "tools": [tool["name"] for tool in first.tools],
        "brief": first.text,
        "before": checked.reward,
        "refused": refused.text if refused.refused else None,
        "done": [checked.done, done.done, late.done],
        "reward": done.reward,
        "late": late.observation.text,
        "state": state.model_dump(),
    }


async def crash(url: str, car: str) -> list[Any]:
    """The end of a design whose simulation crashes."""
    async with BenchClient(base_url=url) as client:
        await client.reset(task="faulty/2")
        checked = await client.step(BenchAction(tool="check", arguments={"machine": car}))
        name = checked.observation.data["machine"]
        done = await client.step(BenchAction(tool="submit", arguments={"machine": name}))
        return [done.done, done.reward, done.observation.text]


async def meet(url: str, car: str) -> dict[str, Any]:
    """Many sessions at a time, of which each has its own machines and seed; then none."""
    clients = [BenchClient(base_url=url) for _ in range(SESSIONS)]
    await asyncio.gather(*(client.connect() for client in clients))
    await asyncio.gather(*(client.state() for client in clients))  # so that all have begun
    one_more = await BenchClient(base_url=url).connect()
    full = (await one_more._receive())["data"]["message"]
    await one_more.close()
    await asyncio.gather(
        *(client.reset(task="movement", seed=seed) for seed, client in enumerate(clients))
    )
    car_action = BenchAction(tool="check", arguments={"machine": car})
    for client in clients[:2]:
        await client.step(car_action)
    history = BenchAction(tool="history")
    told = await asyncio.gather(*(client.step(history) for client in clients))
    states = await asyncio.gather(*(client.state() for client in clients))
    simulate = BenchAction(tool="simulate", arguments={"machine": NAME})
    for client in clients[:2]:
        await client._send({"type": "step", "data": simulate.model_dump()})
    for client in clients[:50]:
        client._ws.transport.abort()  # as a process that was killed
    await asyncio.gather(*(client.close() for client in clients[50:]))
    return {
        "full": full,
        "seeds": [state.seed for state in states],
        "known": [NAME in result.observation.text for result in told].count(True),
        "free": await count_free(url),
    }


async def count_free(url: str) -> int:
    """Sessions that are free, once all are or after a while."""
    for _ in range(100):
        clients = [BenchClient(base_url=url) for _ in range(SESSIONS)]
        await asyncio.gather(*(client.connect() for client in clients))
        asked = (client.state() for client in clients)
        states = await asyncio.gather(*asked, return_exceptions=True)
        await asyncio.gather(*(client.close() for client in clients))
        free = sum(not isinstance(state, Exception) for state in states)
        if free == SESSIONS:
            break
        await asyncio.sleep(0.1)
    return free


def main(car: str, folder: str, code: str) -> None:
    app = make_app(SESSIONS, rollouts=3, engine="mujoco", workers=1, out=Path("runs"))
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        port = found.getsockname()[1]
    server = uvicorn.Server(uvicorn.Config(app, port=port, log_level="error"))
    serving = Thread(target=server.run, daemon=True)
    serving.start()
    while not server.started:
        time.sleep(0.01)
    url = f"http://127.0.0.1:{port}"
    exec(code.replace("http://localhost:8000", url), {})
    found = {
        "played": asyncio.run(play(url, car)),
        "crashed": asyncio.run(crash(url, car)),
        "met": asyncio.run(meet(url, car)),
        "issues": validate_multi_mode_deployment(Path(folder))[1],
    }
    server.should_exit = True
    serving.join()
    print(json.dumps(found))


if __name__ == "__main__":
    main(*sys.argv[1:])
