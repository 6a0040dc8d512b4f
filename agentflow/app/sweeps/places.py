"""Where the runs of a sweep are carried out: in this process, or each on a node of a cluster."""

from __future__ import annotations

import os
import platform
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from contextlib import AsyncExitStack, asynccontextmanager
from functools import partial
from pathlib import Path

from agentflow.app.design.models import choose_models
from agentflow.app.sweeps.folder import STORE
from agentflow.app.sweeps.member import Failure, Outcome, Tell, carry_out
from agentflow.cluster.store import RemoteStore
from agentflow.config.run import DesignConfig
from agentflow.config.sweep import SweepRun
from agentflow.env.pool.base import Simulator
from agentflow.env.pool.pool import RolloutPool
from agentflow.env.pool.store import Store
from agentflow.llm.wrappers.limits import Limiters, LocalLimiters

CarryOut = Callable[[SweepRun, Tell], Awaitable[Outcome]]
"""Carries out a run; receives what it tells."""


@asynccontextmanager
async def carry_out_here(
    folder: Path,
    workers: int,
    shared_store: str | None,
    pool: Simulator | None = None,
    limiters: Limiters | None = None,
) -> AsyncIterator[CarryOut]:
    """Carries out runs in this process, which share `workers` processes, or the given pool."""
    async with AsyncExitStack() as stack:
        if pool is None:
            pool = await stack.enter_async_context(RolloutPool(workers))
        if shared_store is not None:
            pool = RemoteStore(shared_store, pool)
        store, shared = Store(folder / STORE, pool), limiters or LocalLimiters()
        yield lambda run, tell: carry_out(run, folder, store, shared, tell)


@asynccontextmanager
async def carry_out_on_ray(
    folder: Path, workers: int, shared_store: str | None, jobs: int
) -> AsyncIterator[CarryOut]:
    """Carries out each run on a node, with its share of the workers, in a folder that all see."""
    from agentflow.cluster.tasks import LostError, Tasks

    async with Tasks(workers // jobs) as tasks:
        place = folder.resolve(), Path.cwd(), tasks.processors, shared_store

        async def on_node(run: SweepRun, tell: Tell) -> Outcome:
            work = partial(_carry_out_on_node, *place, _keys(run.config), run)
            try:
                outcome: Outcome = await tasks.run(run.name, work, tell)
            except LostError as error:
                return Failure(str(error))
            return outcome

        yield on_node


def _keys(config: DesignConfig) -> dict[str, str]:
    """The keys of a run's endpoints, which the nodes need not know."""
    names = {choice.key_variable or "" for choice in choose_models(config.model).values()}
    return {name: os.environ[name] for name in names if name in os.environ}


async def _carry_out_on_node(
    folder: Path,
    directory: Path,
    workers: int,
    shared_store: str | None,
    keys: Mapping[str, str],
    run: SweepRun,
    limiters: Limiters,
    tell: Tell,
) -> Outcome:
    """Carry out a run in this process of a node, in the working directory of the sweep."""
    for needed in (folder, directory):
        if not needed.is_dir():
            return Failure(
                f"the node {platform.node()} does not see {needed}: start the sweep in a folder "
                "that all nodes share"
            )
    os.environ.update(keys)
    os.chdir(directory)  # relative paths of the configuration mean the same
    async with carry_out_here(folder, workers, shared_store, limiters=limiters) as carry:
        return await carry(run, tell)
