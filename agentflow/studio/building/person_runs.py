"""Tests of machines that people build: each task has a run, with a person as its author."""

from __future__ import annotations

import asyncio
from contextlib import AsyncExitStack
from typing import Any

from agentflow.app.design.config import load_config
from agentflow.app.sessions.clients import ClientRuns, RunSession
from agentflow.config.run import PROCEDURAL
from agentflow.machine import Machine
from agentflow.runs import read_result
from agentflow.runs.locations import FEEDBACK
from agentflow.studio.folder import RunFolder
from agentflow.studio.guard import Refusal
from agentflow.studio.simulations import Simulations

PERSON = "a person in the studio"
"""Author of these runs."""
TESTS = 2000
"""Most tests of one run; a bench keeps as many machines."""


class PersonRuns(AsyncExitStack):
    """Tests machines and records each test in a run; leaving the context completes all runs."""

    def __init__(self, folder: RunFolder, simulations: Simulations) -> None:
        """Prepare; the first test of a task begins its run."""
        super().__init__()
        self._folder, self._simulations = folder, simulations
        self._open: dict[str, RunSession] = {}
        self._turn = asyncio.Lock()

    async def test(self, task: str, machine: Machine) -> dict[str, Any]:
        """Simulate a machine, once; score, status, feedback and the run that holds the record.

        Raises:
            Refusal: It is not valid for the task, or the run has no test left.
        """
        session = await self._session(task)
        bench = await session.bench()
        if bench is None:
            del self._open[task]
            raise Refusal(409, "this run has ended; test again to begin another one")
        checked = await bench.call("check", {"machine": machine.to_text()})
        if checked.refused:
            raise Refusal(400, checked.text)
        told = await bench.call("simulate", {"machine": checked.data["machine"]})
        if told.refused:
            raise Refusal(400, told.text)
        kept = ("score", "status", "feedback")
        return {key: told.data[key] for key in kept} | {"run": self._name(session)}

    async def finish(self, task: str) -> dict[str, Any]:
        """Complete the run of a task; its best machine is the result.

        Raises:
            Refusal: Nothing has been tested.
        """
        session = self._open.pop(task, None)
        if session is None:
            raise Refusal(400, f"nothing has been tested on {task}, so there is nothing to finish")
        await session.finish()
        result = read_result(self._folder.run(self._name(session)))
        return {"run": self._name(session), "score": result.score}

    async def _session(self, task: str) -> RunSession:
        async with self._turn:
            if task not in self._open:
                options = {"task": task, "settings.max_simulations": TESTS}
                ours = ("workflow=tools", f"model.name={PROCEDURAL}", "candidates_per_stage=1")
                config = load_config(None, (*ours, "verify=false"), options)
                runs = ClientRuns(
                    config, self._folder.root, (FEEDBACK,), self._simulations, lambda _: None
                )
                await self.enter_async_context(runs)
                self._open[task] = runs.open(PERSON)
            return self._open[task]

    def _name(self, session: RunSession) -> str:
        return self._folder.name_of(session.path)
