"""The runs of a sweep: each started or resumed, in this process or on a node of a cluster."""

import os
import platform
import shutil
import traceback
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from contextlib import asynccontextmanager, nullcontext
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from agentflow.app.design.config import config_json
from agentflow.app.design.plan import RunPlan
from agentflow.app.design.run import RunOptions, design_async, resume_async
from agentflow.app.sweeps.folder import RUNS, STORE
from agentflow.cluster.store import RemoteStore
from agentflow.config.run import DesignConfig
from agentflow.config.sweep import SweepRun
from agentflow.env.pool.pool import RolloutPool, Simulator
from agentflow.env.pool.store import Store
from agentflow.errors import AgentflowError, EndpointError, RunError
from agentflow.llm.messages import Client
from agentflow.llm.wrappers.limits import Limiters, LocalLimiters
from agentflow.models.choices import choose_models
from agentflow.runs import Event, RunResult, read_document
from agentflow.runs.events import RunEvent


@dataclass(frozen=True)
class Failure:
    """Why a run failed."""

    reason: str
    trace: str | None = None
    endpoint: bool = False
    """Whether the endpoint could not be used."""

    @property
    def line(self) -> str:
        """The reason in one line."""
        return self.reason.strip().partition("\n")[0]


Outcome = RunResult | Failure
Tell = Callable[[RunEvent | Event | str], None]
"""Receives the events of a run, and its remarks for the user."""
CarryOut = Callable[[SweepRun, Tell], Awaitable[Outcome]]


ClientOf = Callable[[SweepRun], "Client | None"]
"""What answers in a run in place of its models; None for the models."""


def models_answer(_run: SweepRun) -> Client | None:
    """The configured models answer in every run."""
    return None


async def _carry_out(
    run: SweepRun, folder: Path, store: Store, limiters: Limiters, client: Client | None, tell: Tell
) -> Outcome:
    """Carry out a run in the folder of its sweep, and link its files to those of the store.

    Args:
        run: The run, possibly started by an earlier process.
        folder: The sweep's folder.
        store: Simulates its machines.
        limiters: Shared with the other runs.
        client: Answers in place of the models.
        tell: Receives events and remarks.
    """
    options = RunOptions(
        tell, tell, client, pool=store, limiters=limiters, named=config_json(run.config)
    )
    try:
        if _can_resume(path := folder / RUNS / run.name):
            require_same_plan(RunPlan.of(run.config), path)
            result = await resume_async(path, options)
        else:
            result = await design_async(run.config, folder / RUNS, options, run.name)
        store.share(path, RunPlan.of(run.config).task, run.config.seed)
    except AgentflowError as error:
        # A run says how to resume it alone; here, the sweep is resumed.
        own = error.__cause__ if isinstance(error.__cause__, type(error)) else error
        return Failure(str(own), endpoint=isinstance(error, EndpointError))
    except Exception as error:  # noqa: BLE001 - logged in full; other runs continue
        return Failure(f"{type(error).__name__}: {error}", traceback.format_exc())
    return result


def require_same_plan(plan: RunPlan, path: Path) -> None:
    """Refuse to mix new runs with one that was made under different conditions.

    Raises:
        RunError: The run at this path was.
    """
    if changes := plan.changes_since(read_document(path)):
        raise RunError(
            f"{path.parents[1]}: {path.name} was made with different {changes}: the remaining runs "
            "would not be comparable; choose another folder with --out"
        )


def _can_resume(path: Path) -> bool:
    """Whether a run can be resumed. Removes a folder whose run.yaml was never completed."""
    if path.exists() and all(entry.name.endswith("-run.yaml") for entry in path.iterdir()):
        shutil.rmtree(path)
    return path.exists()


@asynccontextmanager
async def carry_out_here(
    folder: Path,
    workers: int,
    shared_store: str | None,
    pool: Simulator | None = None,
    limiters: Limiters | None = None,
    client_of: ClientOf = models_answer,
) -> AsyncIterator[CarryOut]:
    """Carries out runs in this process, which share `workers` processes, or the given pool."""
    async with RolloutPool(workers) if pool is None else nullcontext(pool) as simulator:
        known = simulator if shared_store is None else RemoteStore(shared_store, simulator)
        store, shared = Store(folder / STORE, known), limiters or LocalLimiters()
        yield lambda run, tell: _carry_out(run, folder, store, shared, client_of(run), tell)


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
