"""Coroutine functions on nodes of a cluster."""

from __future__ import annotations

import asyncio
import os

import pytest

pytest.importorskip("ray")

from agentflow.cluster.connection import connect
from agentflow.cluster.tasks import Tasks, Tell
from agentflow.llm.wrappers.limits import Limiters

pytestmark = [
    pytest.mark.cluster,
    pytest.mark.slow,
    pytest.mark.usefixtures("cluster"),
    pytest.mark.filterwarnings("ignore::ResourceWarning"),  # Ray leaves processes to its reaper
]


async def test_a_function_that_has_ended_leaves_its_process_to_the_next() -> None:
    reports = list[str]()

    async def work(_: Limiters, tell: Tell) -> int:
        tell("at work")
        return os.getpid()

    connect(2)
    async with Tasks(1) as tasks:
        calls = (tasks.run(f"task {n}", work, reports.append) for n in range(60))
        found = await asyncio.gather(*calls)
    assert reports == ["at work"] * 60
    assert len(set(found)) <= 2  # one for each node
