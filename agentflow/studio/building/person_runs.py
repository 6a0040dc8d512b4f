"""Tests of machines that people build, recorded in runs with a person as their author."""

from __future__ import annotations

import asyncio
from contextlib import AsyncExitStack
from datetime import datetime
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
        """Prepare; a test that names no open run begins one."""
        super().__init__()
        self._folder, self._simulations = folder, simulations
        self._open: dict[str, tuple[str, RunSession]] = {}
        """Name of a run -> its task, and what writes it."""
        self._turn = asyncio.Lock()

    async def test(self, task: str, machine: Machine, run: str = "") -> dict[str, Any]:
        """Simulate a machine, once; score, status, feedback and the run that holds the record.

        It is recorded in `run`, an earlier test's; in a new run if that is not open for this task.

        Raises:
            Refusal: It is not valid for the task, or the run has no test left.
        """
        session = await self._session(task, run)
        bench = await session.bench()
        if bench is None:
            self._open.pop(run, None)
            raise Refusal(409, "this run has ended; test again to begin another one")
        checked = await bench.call("check", {"machine": machine.to_text()})
        if checked.refused:
            raise Refusal(400, checked.text)
        told = await bench.call("simulate", {"machine": checked.data["machine"]})
        if told.refused:
            raise Refusal(400, told.text)
        kept, name = ("score", "status", "feedback"), self._folder.name_of(session.path)
        self._open[name] = task, session
        return {key: told.data[key] for key in kept} | {"run": name}

    async def finish(self, run: str) -> dict[str, Any]:
        """Complete a run; its best machine is the result.

        Raises:
            Refusal: It is not open.
        """
        _, session = self._open.pop(run, ("", None))
        if session is None:
            raise Refusal(400, "this run has ended already")
        await session.finish()
        return {"run": run, "score": read_result(self._folder.run(run)).score}

    async def _session(self, task: str, run: str) -> RunSession:
        async with self._turn:
            known, session = self._open.get(run, ("", None))
            if session is None or known != task:
                options = {"task": task, "settings.max_simulations": TESTS}
                ours = ("workflow=tools", f"model.name={PROCEDURAL}", "candidates_per_stage=1")
                config = load_config(None, (*ours, "verify=false"), options)
                runs = ClientRuns(
                    config, self._folder.root, (FEEDBACK,), self._simulations, lambda _: None
                )
                await self.enter_async_context(runs)
                stamp = datetime.now().strftime("%Y%m%d-%H%M%S")
                session = runs.open(PERSON, f"{stamp}-{task.replace('/', '-')}-by-hand")
            return session
