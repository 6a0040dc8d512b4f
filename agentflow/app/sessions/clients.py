"""Sessions that are runs of the workflow `tools`, with a client or a person as the worker."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from shlex import quote
from typing import Any

from agentflow.app.design.config import load_config
from agentflow.app.design.run import DesignRun, RunOptions
from agentflow.app.subjects.verify import verify_finished
from agentflow.config.run import PROCEDURAL, DesignConfig
from agentflow.env.pool.pool import Simulator
from agentflow.errors import AgentflowError, EndpointError, UsageError
from agentflow.runs import Notify, RunResult, read_result
from agentflow.runs.locations import StageName
from agentflow.runs.reading import EVENTS
from agentflow.tools import Bench
from agentflow.workflows.tools import Worker, workflow_of

PATIENCE = 20.0
"""Seconds that a client waits for the verification of its machine; clients give up after 60."""
Begin = Callable[[Worker], DesignRun]


def session_config(
    given: Sequence[str], keys: Mapping[str, object], *, stages: bool = False
) -> DesignConfig:
    """The configuration of runs that a client designs; without `stages`, it simulates at once and
    submits one machine.

    Raises:
        UsageError: A setting is wrong, or names a workflow or a model.
    """
    ours = ["workflow=tools", f"model.name={PROCEDURAL}"]  # a model that nobody asks
    defaults = ["vision=true", *([] if stages else ["candidates_per_stage=1"])]
    config = load_config(None, [*ours, *defaults, *given], keys)
    if (config.workflow, config.model.name) != ("tools", PROCEDURAL):
        raise UsageError(
            "here the agent designs, so there is no workflow and no model to set; remove workflow "
            "and model.name from --set"
        )
    return config


def summarise_end(result: RunResult, *, verifying: bool = False) -> str:
    """How the run of a client ended and where it is; `verifying` if that still goes on."""
    told = "without a valid machine"
    if result.score is not None:
        told = f"with a plain score of {result.score:.2f}"
        if result.verified_score is not None:
            told = f"with a verified score of {result.verified_score:.2f} (plain: "
            told += f"{result.score:.2f})"
            told += f", which {held}" if (held := result.holding) else ""
        elif verifying:
            told += "; it is still being verified, and any later call tells the result"
    return (
        f"The design is finished, {told}. It is in {quote(result.run)}; `agentflow show` and "
        "`agentflow report` show more."
    )


class RunSession:
    """The run of one client, from its first request until its last stage or until it leaves.

    The result is on disk before it is verified, because a client may end this process when it
    leaves. A client that made no machine leaves no run behind.
    """

    def __init__(
        self, begin: Begin, verify: Callable[[Path], Awaitable[bool]], notify: Notify
    ) -> None:
        """Prepare a session; `verify` verifies the finished run in a folder, and says whether that
        goes on."""
        self._begin, self._verify, self._notify = begin, verify, notify
        self._run: DesignRun | None = None
        self._working: asyncio.Task[None] | None = None
        self._bench: Bench | None = None
        self._opening: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        """Done when the next bench is there."""
        self._gone = asyncio.Event()
        self._verifying = False
        """Whether the run was finished before its verification."""

    async def bench(self) -> Bench | None:
        """The bench of the current stage, once it is ready; None after the last stage.

        Raises:
            AgentflowError: The run cannot begin or go on.
        """
        if self._working is None:
            self._run = self._begin(self._work)
            self._working = asyncio.create_task(self._carry_out(self._run))
            self._working.add_done_callback(self._tell_failure)
        while not self._working.done():
            if self._bench is not None and not self._bench.ended:
                return self._bench
            either: set[asyncio.Future[Any]] = {self._working, self._opening}
            await asyncio.wait(either, return_when="FIRST_COMPLETED")
        self._working.result()
        return None

    async def _carry_out(self, run: DesignRun) -> None:
        try:
            await run.carry_out()
        except EndpointError:  # of _work
            return
        self._verifying = await self._verify(run.directory.path)

    def _tell_failure(self, working: asyncio.Task[None]) -> None:
        """Say why the run stopped, also if the client has left and cannot be informed."""
        if working.cancelled():
            return
        try:
            working.result()
        except AgentflowError as error:
            self._notify(str(error))

    async def _work(self, bench: Bench, _stage: StageName) -> None:
        """Let the client work until the stage ends or the client leaves."""
        opening, self._opening = self._opening, asyncio.get_running_loop().create_future()
        self._bench = bench
        opening.set_result(None)
        waiting = {asyncio.create_task(bench.wait_ended()), asyncio.create_task(self._gone.wait())}
        try:
            await asyncio.wait(waiting, return_when="FIRST_COMPLETED")
        finally:
            for task in waiting:
                task.cancel()
        if self._gone.is_set():
            if not len(bench.machines):
                raise EndpointError("the client left without making a machine")
            bench.end("the client left")

    @property
    def last(self) -> Bench | None:
        """The bench of the last stage, for a client that has not left and reads there."""
        return self._bench

    @property
    def path(self) -> Path:
        """The directory of the run, which its first bench begins."""
        assert self._run is not None
        return self._run.directory.path

    @property
    def farewell(self) -> str:
        """How the run ended and where it is."""
        assert self._run is not None
        told = summarise_end(read_result(self.path), verifying=self._verifying)
        reading = self._bench.reading if self._bench else ()
        still = ", ".join(f"`{spec.name}`" for spec in reading)
        return f"{told} These tools still answer: {still}. Connect again to start another one."

    @property
    def outcome(self) -> Mapping[str, Any]:
        """The same as data; `verifying` says whether a verified score is still to come."""
        result = read_result(self.path)
        verified = result.verified_score
        scores = {"score": result.score, "verified_score": verified}
        return {"run": result.run, **scores, "verifying": self._verifying and verified is None}

    @property
    def events(self) -> str:
        """What the run has recorded so far, one JSON object per line."""
        if self._run is None:
            return ""
        return (self._run.directory.path / EVENTS).read_text(encoding="utf-8")

    @property
    def is_over(self) -> bool:
        """Whether the client has left, and its run, if any, is complete."""
        return self._gone.is_set() and (self._working is None or self._working.done())

    def leave(self) -> None:
        """End the run with what the client has done."""
        self._gone.set()
        self._bench = None  # with every rollout of the run

    async def finish(self) -> None:
        """Leave, and wait until the run is complete."""
        self.leave()
        if self._working is not None:
            await asyncio.wait({self._working})


class ClientRuns:
    """The sessions of all clients, which share a pool. Leaving the context completes their runs."""

    def __init__(
        self,
        config: DesignConfig,
        out: Path,
        stages: Sequence[StageName],
        pool: Simulator,
        notify: Notify,
    ) -> None:
        """Prepare for clients whose runs go through `stages` and are written below `out`."""
        self._config = config.model_copy(update={"verify": False})  # done once a run is complete
        self._verifies = config.verify
        self._out, self._stages, self._pool, self._notify = out, stages, pool, notify
        self._sessions: list[RunSession] = []
        self._verifying: set[asyncio.Task[Any]] = set()
        self._turn = asyncio.Lock()

    def open(self, author: str, name: str = "") -> RunSession:
        """The session of a new client; `author` is who results say has designed, `name` that of
        the run."""
        begin = partial(self._begin, author, name)
        session = RunSession(begin, self._verify, self._notify)
        self._sessions = [*(one for one in self._sessions if not one.is_over), session]
        return session

    def _begin(self, author: str, name: str, worker: Worker) -> DesignRun:
        workflow = workflow_of(worker, author, self._stages)
        options = RunOptions(self._notify, pool=self._pool, workflow=workflow)
        run = DesignRun.create(self._config, self._out, options, name)
        self._notify(f"{author}: {run.directory.path}")
        return run

    async def _verify(self, path: Path) -> bool:
        """Verify a finished run, if that is configured, and wait a while for the result; returns
        whether it is still to come.

        The runs alternate, so that clients that still design need not wait for many verifications.
        """

        async def take_turn() -> None:
            async with self._turn:
                await verify_finished(path, self._pool)

        if not self._verifies:
            return False
        task = asyncio.create_task(take_turn())
        self._verifying.add(task)
        task.add_done_callback(self._verifying.discard)
        return bool((await asyncio.wait({task}, timeout=PATIENCE))[1])

    async def __aenter__(self) -> ClientRuns:
        return self

    async def __aexit__(self, *_: object) -> None:
        await asyncio.gather(*(session.finish() for session in self._sessions))
        await asyncio.gather(*self._verifying)
