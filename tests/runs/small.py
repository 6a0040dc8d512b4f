"""A small hierarchical run on disk, with slow scripted replies and looked-up scores."""

from __future__ import annotations

import asyncio
import json
import math
import os
import random
from pathlib import Path

from agentflow.agents.base import AskContext
from agentflow.llm.build import wrap
from agentflow.llm.messages import Client, ClientWrapper, Reply, Request
from agentflow.llm.wrappers.budget import Budget
from agentflow.llm.wrappers.record import CallLog
from agentflow.runs import RunDirectory, RunResult
from agentflow.workflows.base import WorkflowResult, stage_row
from agentflow.workflows.hierarchical import HIERARCHICAL
from agentflow.workflows.settings import WorkflowSettings
from tests.runs.results import a_result
from tests.scripted import ScriptedClient
from tests.workflows.fakes import BRIEF, PROMPTS, Author, Delayed, Shelf

SETTINGS = WorkflowSettings.model_validate(
    {"trajectories": 3, "search": {"rounds": 3, "width": 2, "request_rounds": 2}}
)


class Asked:
    """An author that logs requests to a file, which survives a kill."""

    def __init__(self, log: Path) -> None:
        self.author, self.log = Author(seed=4), log

    def __call__(self, request: Request) -> Reply:
        with self.log.open("a") as lines:
            lines.write(request.label + "\n")
        return self.author(request)


class Stalling(ClientWrapper):
    """Answers a number of requests and lets the others wait for ever."""

    def __init__(self, inner: Client, most: float) -> None:
        super().__init__(inner)
        self.left = most

    async def complete(self, request: Request) -> Reply:
        self.left -= 1
        if self.left < 0:
            await asyncio.Event().wait()
        return await self._inner.complete(request)


def begin(folder: Path, log: Path, chance: int, most: float = math.inf) -> Path:
    """Carry out a new run in a folder, up to a number of calls."""
    return _carry_out(RunDirectory.create(folder, "run", {"config": {}}), log, chance, most)


def begin_to_be_killed(folder: Path, log: Path, chance: int, most: float) -> None:
    """The same, in a process that will be killed."""
    (folder / "started").write_text("")
    begin(folder, log, chance, most)


def go_on(path: Path, log: Path, chance: int) -> Path:
    """Finish an unfinished run."""
    return _carry_out(RunDirectory.resume(path), log, chance)


def _carry_out(run: RunDirectory, log: Path, seed: int, most: float = math.inf) -> Path:
    chance = random.Random(seed)
    with CallLog(run.call_log, lambda _line: None) as call_log:
        inner = Stalling(Delayed(ScriptedClient(Asked(log)), chance), most)
        context = AskContext(wrap(inner, call_log=call_log, budget=Budget()), PROMPTS, max_retry=3)
        result = asyncio.run(
            HIERARCHICAL(BRIEF, lambda _role: context, Shelf(delays=chance), SETTINGS, run, 0)
        )
    run.finish(_told(result))
    run.close()
    return run.path


def _told(result: WorkflowResult) -> RunResult:
    assert result.best is not None
    assert result.best.machine is not None
    stages = [stage_row(stage) for stage in result.stages]
    return a_result(machine=result.best.machine.to_json(), stages=stages)


def contents(path: Path) -> dict[str, list[str]]:
    """Every file of a run, with sorted lines and without timings."""
    found = {}
    for file in sorted(path.rglob("*")):
        if file.is_file():
            name = os.fspath(file.relative_to(path))
            text = file.read_text()
            found[name] = sorted(map(_line, text.splitlines())) if ".jsonl" in name else [text]
    return found


def _line(line: str) -> str:
    item = json.loads(line)
    item.pop("at", None)
    item.get("reply", {}).pop("latency_s", None)
    return json.dumps(item)
