"""Owns design runs for Python programs (spec 6.6): what `agentflow design` does, as functions.

Machines alone are machines.py's, rewards rewards.py's.
"""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from agentflow.app.design import design as runs
from agentflow.app.design.models import completed
from agentflow.app.design.remarks import Say
from agentflow.app.python.functions import FunctionClient, ModelFunction
from agentflow.config.run import PROCEDURAL, DesignConfig, build, load, put
from agentflow.env.pool.pool import RolloutPool
from agentflow.errors import UsageError
from agentflow.machine import Machine, library, read_machine
from agentflow.runs import Listener


@dataclass(frozen=True)
class Design:
    """What a design run came to."""

    run: Path
    """The run directory."""
    valid: bool
    """Whether any valid machine was found."""
    score: float | None
    """Of the best machine, in the task's unit; None without one."""
    machine: Machine | None
    """The best machine."""
    model: str
    """Who answered, as shown in results."""
    stages: tuple[Mapping[str, Any], ...]
    """Rows of the stage table."""
    stopped: str | None
    """`budget` when that ended the run early."""
    data: Mapping[str, Any] = field(repr=False)
    """Everything in result.json: calls, tokens, cost, seconds, reason, ..."""


def design(
    task: str | None = None,
    *,
    workflow: str | None = None,
    model: str | None = None,
    base_url: str | None = None,
    answer: ModelFunction | None = None,
    config: Path | Mapping[str, Any] | None = None,
    settings: Mapping[str, object] | None = None,
    seed: int | None = None,
    out: Path | str = "runs",
    workers: int | None = None,
    say: Say | None = None,
    listener: Listener | None = None,
) -> Design:
    """Design a machine: from a task to the best machine found, kept in a run directory.

    What is not given is as on the command line: from `config`, else from the environment
    (AGENTFLOW_MODEL, OPENAI_BASE_URL), else the default.

    Args:
        task: Level, for instance "throwing".
        workflow: hierarchical, iterative, single, random-dsl ...
        model: Name of the model at the endpoint, or the name to show for `answer`.
        base_url: OpenAI-compatible endpoint; the key is in OPENAI_API_KEY.
        answer: A function of your own that answers every request, instead of an endpoint.
        config: YAML file, or its content as a mapping.
        settings: Dotted keys of the configuration or knobs of the task, as `--set` takes them.
        seed: Of everything left to chance.
        out: Folder that holds run directories.
        workers: Processes for rollouts.
        say: Takes remarks, one line each; by default they go to stderr.
        listener: Told every event.

    Raises:
        UsageError: A name or value is wrong, or the folder cannot be written.
        EndpointError: The model cannot be used.
        InterruptedRunError: Ctrl-C; the run can be resumed.
    """
    _demand_no_loop("design")
    options = _options(task, workflow, model, base_url, seed, workers)
    built, client = _prepared(config, settings, options, answer)
    return _design(runs.design(built, Path(out), say or _remark, listener, client))


async def design_async(
    task: str | None = None,
    *,
    workflow: str | None = None,
    model: str | None = None,
    base_url: str | None = None,
    answer: ModelFunction | None = None,
    config: Path | Mapping[str, Any] | None = None,
    settings: Mapping[str, object] | None = None,
    seed: int | None = None,
    out: Path | str = "runs",
    workers: int | None = None,
    say: Say | None = None,
    listener: Listener | None = None,
    pool: RolloutPool | None = None,
) -> Design:
    """`design` on a running event loop, where several runs may share a `pool`.

    Raises:
        UsageError: As `design`.
        EndpointError: The model cannot be used.
    """
    options = _options(task, workflow, model, base_url, seed, workers)
    built, client = _prepared(config, settings, options, answer)
    return _design(
        await runs.design_async(built, Path(out), say or _remark, listener, client, pool)
    )


def resume(
    run: Path | str,
    *,
    answer: ModelFunction | None = None,
    say: Say | None = None,
    listener: Listener | None = None,
) -> Design:
    """Continue a run; no recorded question is asked again. A finished run gives its result.

    Args:
        run: The run directory.
        answer: The function that answered, when the run was begun with one.
        say: Takes remarks; by default they go to stderr.
        listener: Told every event.

    Raises:
        RunError: It is no run, damaged, in use, or was begun with other prompts, demands of the
            task or physics.
        EndpointError: The model cannot be used.
        InterruptedRunError: Ctrl-C; the run can be resumed again.
    """
    _demand_no_loop("resume")
    path = Path(run)
    return _design(runs.resume(path, say or _remark, listener, _client_for(path, answer)))


async def resume_async(
    run: Path | str,
    *,
    answer: ModelFunction | None = None,
    say: Say | None = None,
    listener: Listener | None = None,
    pool: RolloutPool | None = None,
) -> Design:
    """`resume` on a running event loop.

    Raises:
        RunError: As `resume`.
        EndpointError: The model cannot be used.
    """
    path, client = Path(run), _client_for(Path(run), answer)
    return _design(await runs.resume_async(path, say or _remark, listener, client, pool))


def _options(
    task: str | None,
    workflow: str | None,
    model: str | None,
    base_url: str | None,
    seed: int | None,
    workers: int | None,
) -> dict[str, object]:
    given: dict[str, object] = {
        "task": task,
        "workflow": workflow,
        "model.name": model,
        "model.base_url": base_url,
        "seed": seed,
        "workers": workers,
    }
    return {key: value for key, value in given.items() if value is not None}


def _prepared(
    config: Path | Mapping[str, Any] | None,
    settings: Mapping[str, object] | None,
    options: Mapping[str, object],
    answer: ModelFunction | None,
) -> tuple[DesignConfig, FunctionClient | None]:
    """The configuration, and the client when a function answers."""
    document = load(config) if isinstance(config, Path) else dict(config or {})
    named = {} if answer is None else {"model.name": _name_of(answer)}
    for key, value in {**(settings or {}), **named, **options}.items():
        document = put(document, key, value)
    if answer is None:
        return completed(document), None
    built = build(document)
    if built.model.name == PROCEDURAL or built.model.roles:
        raise UsageError(
            f"answer= stands for one model: give it another name than {PROCEDURAL!r}, and no roles"
        )
    return built, FunctionClient(answer, built.model.name)


def _name_of(answer: ModelFunction) -> str:
    return getattr(answer, "__name__", type(answer).__name__)


def _client_for(path: Path, answer: ModelFunction | None) -> FunctionClient | None:
    if answer is None:
        return None
    document = load(path / "run.yaml")
    return FunctionClient(answer, build(document).model.name)


def _design(result: Mapping[str, Any]) -> Design:
    found = result["machine"]
    return Design(
        run=Path(result["run"]),
        valid=result["valid"],
        score=result["score"],
        machine=None if found is None else read_machine(found, tuple(library())).machine,
        model=result["model"],
        stages=tuple(result["stages"]),
        stopped=result["stopped"],
        data=result,
    )


def _demand_no_loop(name: str) -> None:
    try:
        asyncio.get_running_loop()
    except RuntimeError:
        return
    raise UsageError(f"{name} waits for its run; on a running event loop, await {name}_async")


def _remark(line: str) -> None:
    print(f"agentflow: {line}", file=sys.stderr)
