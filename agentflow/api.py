"""What Python programs call: design and resume runs, check and simulate machines.

Functions import what they need when called, so that checking a machine loads no physics.
"""

from __future__ import annotations

import asyncio
import os
import re
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict, overload

from agentflow.errors import UsageError
from agentflow.machine import Machine, Report
from agentflow.machine import check as check_machine
from agentflow.machine.brief import Brief, Limits
from agentflow.machine.formats.detect import read_for
from agentflow.machine.tree import MachineJson

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from agentflow.app.design.run import RunOptions
    from agentflow.config.run import DesignConfig
    from agentflow.env.pool.pool import Pool
    from agentflow.env.rollout import Rollout
    from agentflow.env.tasks.base import Task
    from agentflow.env.verification import Verification
    from agentflow.llm.function import FunctionClient, ModelFunction
    from agentflow.machine.building import MachineBuilder
    from agentflow.notebook.recorded import Sweep
    from agentflow.runs import Listener, Notify, RunResult

MachineLike = Machine | str | list[dict[str, Any]] | dict[str, Any] | Path
"""A machine: an object, any text that holds one (also .bsg), JSON data, or the path of a file."""
_OPTIONS = ("task", "workflow", "model.name", "model.base_url", "engine", "seed", "workers")
"""Configuration keys that are arguments of `design`."""


@dataclass(frozen=True)
class Design:
    """The result of a design run."""

    run: Path
    """The run directory."""
    valid: bool
    """Whether any valid machine was found."""
    score: float | None
    """Score of the best machine, in the task's unit; None if no machine was valid."""
    verified: float | None
    """Verified score of the best machine; None if no machine was valid, verification is switched
    off, or one of its simulations failed."""
    fragile: bool | None
    """Whether the best machine fails under some small change; None without a verified score."""
    machine: Machine | None
    """The best machine."""
    model: str
    """Name of the model."""
    stages: tuple[Mapping[str, Any], ...] = field(repr=False)
    """Rows of the stage table."""
    stopped: str | None
    """Why the run ended early: `budget`, or `greatest score` if a machine reached it."""
    data: Mapping[str, Any] = field(repr=False)
    """Everything in result.json: calls, tokens, cost, seconds, reason, ..."""


class DesignOptions(TypedDict, total=False):
    """The arguments of `design` and `design_async` besides task, seeds and pool."""

    workflow: str | None
    model: str | None
    base_url: str | None
    answer: ModelFunction | None
    config: Path | str | Mapping[str, Any] | None
    settings: Mapping[str, object] | None
    engine: str | None
    seed: int | None
    jobs: int
    out: Path | str
    workers: int | None
    trust: bool
    say: Notify | None
    listener: Listener | None


@overload
def design(
    task: str | None = None, *, seeds: None = None, **options: Unpack[DesignOptions]
) -> Design: ...


@overload
def design(
    task: str | None = None, *, seeds: int | Sequence[int], **options: Unpack[DesignOptions]
) -> Sweep: ...


def design(
    task: str | None = None,
    *,
    workflow: str | None = None,
    model: str | None = None,
    base_url: str | None = None,
    answer: ModelFunction | None = None,
    config: Path | str | Mapping[str, Any] | None = None,
    settings: Mapping[str, object] | None = None,
    engine: str | None = None,
    seed: int | None = None,
    seeds: int | Sequence[int] | None = None,
    jobs: int = 2,
    out: Path | str = "runs",
    workers: int | None = None,
    trust: bool = False,
    say: Notify | None = None,
    listener: Listener | None = None,
) -> Design | Sweep:
    """Design a machine for a task, in a new run directory.

    As on the command line, missing values come from `config`, then the environment
    (AGENTFLOW_MODEL, OPENAI_BASE_URL), then the defaults.

    Args:
        task: Level, e.g. "throwing".
        workflow: hierarchical, iterative, single, random-dsl ...
        model: Name of the model at the endpoint, or the name to show for `answer`.
        base_url: OpenAI-compatible endpoint; the key is in OPENAI_API_KEY.
        answer: Your own function that answers every request, instead of an endpoint.
        config: YAML file, or its content as a mapping. Those that ship with the package have short
            names, such as "small".
        settings: Dotted configuration keys, or knobs of the task, like `--set`.
        engine: Physics engine; "auto" is the first that is installed.
        seed: Random seed.
        seeds: Several random seeds, or their number; the result is a `Sweep`, whose `summary` has
            the mean score, its interval over the runs and the best one.
        jobs: Number of concurrent runs, with several seeds.
        out: Parent folder of the run directory.
        workers: Worker processes for simulation.
        trust: Send prompts and keys where the file in `config` says, and run the program that it
            says, even if neither the call nor the environment names them.
        say: Receives messages, one line each; by default they are printed to stderr.
        listener: Receives every event.

    Raises:
        UsageError: A name or value is wrong, or the folder cannot be written.
        EndpointError: The model cannot be used.
        InterruptedRunError: Ctrl-C; the run can be resumed.
    """
    from agentflow.app.design import run

    _require_no_event_loop("design")
    given = _config_keys(settings, task, workflow, model, base_url, engine, seed, workers)
    built, client = _configure(config, given, answer, trust)
    if seeds is not None:
        from agentflow.notebook.sweeping import plan_seeds

        work = plan_seeds(built, client, seeds, seed, Path(out))
        told = say or _print_remark
        return work.wait_for(work.carry_out(told, jobs=jobs, listener=listener))
    run_options = run.RunOptions(say or _print_remark, listener, client)
    return _to_design(run.design(built, Path(out), run_options))


@overload
async def design_async(
    task: str | None = None,
    *,
    seeds: None = None,
    pool: Pool | None = None,
    **options: Unpack[DesignOptions],
) -> Design: ...


@overload
async def design_async(
    task: str | None = None,
    *,
    seeds: int | Sequence[int],
    pool: Pool | None = None,
    **options: Unpack[DesignOptions],
) -> Sweep: ...


async def design_async(
    task: str | None = None,
    *,
    workflow: str | None = None,
    model: str | None = None,
    base_url: str | None = None,
    answer: ModelFunction | None = None,
    config: Path | str | Mapping[str, Any] | None = None,
    settings: Mapping[str, object] | None = None,
    engine: str | None = None,
    seed: int | None = None,
    seeds: int | Sequence[int] | None = None,
    jobs: int = 2,
    out: Path | str = "runs",
    workers: int | None = None,
    trust: bool = False,
    say: Notify | None = None,
    listener: Listener | None = None,
    pool: Pool | None = None,
) -> Design | Sweep:
    """Like `design`, on a running event loop, where several runs can share a `pool`.

    Notebooks have one: `await agentflow.design_async(...)` works in a cell, which shows progress.
    """
    from agentflow.app.design import run
    from agentflow.notebook.display.progress import run_listener

    given = _config_keys(settings, task, workflow, model, base_url, engine, seed, workers)
    built, client = _configure(config, given, answer, trust)
    if seeds is not None:
        from agentflow.notebook.sweeping import plan_seeds

        work = plan_seeds(built, client, seeds, seed, Path(out))
        told = say or _print_remark
        return await work.carry_out(told, jobs=jobs, listener=listener, pool=pool)
    run_options = run.RunOptions(say or _print_remark, run_listener(listener), client, pool)
    return _to_design(await run.design_async(built, Path(out), run_options))


def sweep(
    config: Path | str | Mapping[str, Any],
    *,
    answer: ModelFunction | None = None,
    seeds: int | Sequence[int] | None = None,
    model: str | None = None,
    base_url: str | None = None,
    settings: Mapping[str, object] | None = None,
    engine: str | None = None,
    workers: int | None = None,
    jobs: int = 2,
    out: Path | str = "sweeps",
    name: str | None = None,
    resume: bool = False,
    trust: bool = False,
    say: Notify | None = None,
) -> Sweep:
    """Run configurations that differ in a few settings, each with every seed.

    Args:
        config: A sweep file (those that ship have short names, such as "inspector"), or a sweep
            directory to continue, or its content as a mapping, or a grid: keys of the configuration
            and knobs, each with one value for all runs or with a list of values to compare, as in
            `{"task": "throwing", "search.rounds": [0, 5]}`. The key `answer` compares
            functions: `{"answer": [first, second]}`.
        answer: Your own function that answers every request of every run. Requests say for which
            run they are: `run` and `run_seed`.
        seeds: Several random seeds, or their number, in place of the sweep's.
        model: Name of the model at the endpoint, or the name to show for `answer`.
        base_url: OpenAI-compatible endpoint; the key is in OPENAI_API_KEY.
        settings: Dotted configuration keys, or knobs, for all runs.
        engine: Physics engine.
        workers: Worker processes for simulation, for all runs together.
        jobs: Number of concurrent runs.
        out: Parent folder of the sweep directory.
        name: Name of the sweep directory; by default the date and the name of the sweep.
        resume: Continue the sweep that the directory holds.
        trust: Send prompts and keys where the file in `config` says, even if neither the call nor
            the environment names it.
        say: Receives messages, one line each; by default they are printed to stderr. Notebooks
            also show progress.

    Raises:
        UsageError: A name or value is wrong, or the folder holds a sweep and `resume` is not set.
        RunError: Every run has failed; the message has the first reason.
        InterruptedRunError: Ctrl-C; the sweep can be resumed.
    """
    from agentflow.notebook.sweeping import plan_sweep

    _require_no_event_loop("sweep")
    given = _config_keys(settings, None, None, model, base_url, engine, None, workers)
    work = plan_sweep(config, answer, seeds, given, trust, Path(out), name)
    return work.wait_for(work.carry_out(say or _print_remark, jobs=jobs, resume=resume))


async def sweep_async(
    config: Path | str | Mapping[str, Any],
    *,
    answer: ModelFunction | None = None,
    seeds: int | Sequence[int] | None = None,
    model: str | None = None,
    base_url: str | None = None,
    settings: Mapping[str, object] | None = None,
    engine: str | None = None,
    workers: int | None = None,
    jobs: int = 2,
    out: Path | str = "sweeps",
    name: str | None = None,
    resume: bool = False,
    trust: bool = False,
    say: Notify | None = None,
    pool: Pool | None = None,
) -> Sweep:
    """Like `sweep`, on a running event loop, as notebooks have one, perhaps with a `pool`."""
    from agentflow.notebook.sweeping import plan_sweep

    given = _config_keys(settings, None, None, model, base_url, engine, None, workers)
    work = plan_sweep(config, answer, seeds, given, trust, Path(out), name)
    return await work.carry_out(say or _print_remark, jobs=jobs, resume=resume, pool=pool)


def resume(
    run: Path | str,
    *,
    answer: ModelFunction | None = None,
    trust: bool = False,
    say: Notify | None = None,
    listener: Listener | None = None,
) -> Design:
    """Continue a run; never repeats a recorded call. A finished run returns its result.

    Args:
        run: The run directory.
        answer: Your function, if the run was started with one.
        trust: Send prompts and keys where the run says, and run the program that it says, even if
            the environment does not name them.
        say: Receives messages; by default they are printed to stderr.
        listener: Receives every event.

    Raises:
        RunError: `run` is not a run directory, is damaged or in use, or was started with
            different prompts, task, constants or physics engine.
        EndpointError: The model cannot be used.
        InterruptedRunError: Ctrl-C; the run can be resumed again.
    """
    from agentflow.app.design import run as runs

    _require_no_event_loop("resume")
    options = _options_of_run(Path(run), answer, trust, say, listener)
    return _to_design(runs.resume(Path(run), options))


async def resume_async(
    run: Path | str,
    *,
    answer: ModelFunction | None = None,
    trust: bool = False,
    say: Notify | None = None,
    listener: Listener | None = None,
    pool: Pool | None = None,
) -> Design:
    """Like `resume`, on a running event loop."""
    from agentflow.app.design import run as runs
    from agentflow.notebook.display.progress import run_listener

    options = _options_of_run(Path(run), answer, trust, say, run_listener(listener), pool)
    return _to_design(await runs.resume_async(Path(run), options))


def build(task: str | None = None, **knobs: object) -> MachineBuilder:
    """Begin to build a machine, block by block.

    With `m = agentflow.build("throwing")`, `beam = m.add("Log", to=m.root, face="up")` adds a
    block, and `m.machine` is the machine so far.

    Args:
        task: Level whose block list, limits and given blocks hold, and whose demands a `with` block
            checks at its end; by default the core types and the standard building volume.
        **knobs: Knobs of the level to change, with underscores for dots.

    Raises:
        UsageError: The task or a knob does not exist.
    """
    from agentflow.machine.building import MachineBuilder

    if task is None:
        return MachineBuilder(_brief_of(None, knobs))
    from agentflow.env.tasks.registry import knob_names

    return MachineBuilder(_brief_of(task, knob_names(task, knobs)))


def read_machine(source: str | MachineJson | Path) -> Machine:
    """The machine in a text, JSON data or a file; see `Machine.from_json`."""
    from agentflow.machine.blocks.library import library
    from agentflow.machine.formats.detect import read_any

    if isinstance(source, Path):
        from agentflow.app.machines.files import read_one

        return read_one(str(source))
    if isinstance(source, str):
        _require_text(source)
    reading = read_any(source, blocks=tuple(library()))
    if reading.machine is None or reading.problems or reading.loose:
        raise UsageError((*reading.problems, *reading.loose)[0].message)
    return reading.machine


def edit_machine(
    machine: Machine, script: str, task: str | None, knobs: Mapping[str, object] | None
) -> Machine:
    """The machine after an edit script; see `Machine.edit`."""
    from agentflow.machine.edits.script import apply_script

    outcome = apply_script(machine, script, _brief_of(task, knobs))
    for step in outcome.steps:
        if step.verdict == "Error":
            raise UsageError(f"{step.text.strip()!r} is refused: {step.reason}")
    return outcome.machine


def tune(
    machine: MachineLike,
    task: str,
    *,
    simulations: int = 100,
    settings: Mapping[str, object] | None = None,
    engine: str | None = None,
    seed: int | None = None,
    out: Path | str = "runs",
    workers: int | None = None,
    say: Notify | None = None,
    listener: Listener | None = None,
) -> Design:
    """Improve the numbers of a machine's controls by CMA-ES, in a new run directory.

    Times and levels of its control program and the numbers of its laws change, no block. Resume a
    stopped run with `resume`, which repeats no simulation.

    Args:
        machine: The machine.
        task: Level, e.g. "transport".
        simulations: How many, the first of the machine included.
        settings: Dotted configuration keys, or knobs of the task, like `--set`.
        engine: Physics engine; "auto" is the first that is installed.
        seed: Random seed.
        out: Parent folder of the run directory.
        workers: Worker processes for simulation.
        say: Receives messages, one line each; by default they are printed to stderr.
        listener: Receives every event.

    Raises:
        UsageError: A name or value is wrong, the machine is not valid, or nothing can be tuned.
        ConfigError: The extra `tune` is not installed.
        InterruptedRunError: Ctrl-C; the run can be resumed.
    """
    report = _check(machine, None, Limits())
    if report.machine is None:
        raise UsageError(f"the machine is not valid: {report.problems[0].message}")
    own = {"start": report.machine.to_json(), "max_simulations": simulations}
    return design(
        task,
        workflow="tune",
        settings={**(settings or {}), **own},
        engine=engine,
        seed=seed,
        out=out,
        workers=workers,
        say=say,
        listener=listener,
    )


def check(
    machine: MachineLike,
    task: str | None = None,
    *,
    knobs: Mapping[str, object] | None = None,
    engine: str = "auto",
) -> Report:
    """Check a machine's file, geometry and, with `task`, the rules of a task; no simulation.

    Args:
        machine: The machine.
        task: Level whose rules to check.
        knobs: Knobs of the level to change, e.g. `{"wall.height": 0}`.
        engine: Physics engine, which limits how large a machine may be.

    Raises:
        UsageError: The task, knob, engine or file does not exist, or the machine is a text that
            names a file.
    """
    brief = _brief_of(task, knobs, engine)
    if brief is not None:
        return _check(machine, brief, brief.limits)
    from agentflow.env.physics.engines import choose_engine, engine_limits

    return _check(machine, None, engine_limits(choose_engine(engine).name))


def simulate(
    machine: MachineLike,
    task: str,
    *,
    knobs: Mapping[str, object] | None = None,
    engine: str = "auto",
    seed: int = 0,
    rate: float | None = None,
    power: bool = True,
    interval: float | None = None,
) -> Rollout:
    """Build a machine, simulate it, and score it.

    Args:
        machine: The machine; an invalid one gives a rollout with status `invalid` and score 0.
        task: Level, e.g. "throwing" or "movement/3".
        knobs: Knobs of the level to change.
        engine: Physics engine; "auto" is the first that is installed.
        seed: Random seed.
        rate: Physics steps per second; the default is in the constants.
        power: Whether motors, springs and winches start; without them it is a control experiment.
        interval: Seconds between samples of the trace, 0.2 by default; 0.05 gives a smooth film.

    Raises:
        UsageError: The task, knob, engine or file does not exist, or the rate is out of range.
    """
    from agentflow.env.rollout import invalid_rollout
    from agentflow.env.simulation.simulate import simulate as simulate_machine

    level, report = _read(machine, task, knobs, engine)
    if (built := report.machine) is None:
        return invalid_rollout(report.problems)
    found = simulate_machine(built, level, seed=seed, rate=rate, power=power, interval=interval)
    return replace(found, machine=built)


async def simulate_async(
    machine: MachineLike,
    task: str,
    pool: Pool,
    *,
    knobs: Mapping[str, object] | None = None,
    engine: str = "auto",
    seed: int = 0,
    rate: float | None = None,
    power: bool = True,
    interval: float | None = None,
) -> Rollout:
    """Like `simulate`, in a worker process of a pool, for concurrent use."""
    from agentflow.env.rollout import invalid_rollout

    level, report = _read(machine, task, knobs, engine)
    if (built := report.machine) is None:
        return invalid_rollout(report.problems)
    found = await pool.run(built, level, seed=seed, rate=rate, power=power, interval=interval)
    return replace(found, machine=built)


def verify(
    machine: MachineLike,
    task: str,
    *,
    knobs: Mapping[str, object] | None = None,
    engine: str = "auto",
    seed: int = 0,
) -> Verification:
    """Verify a machine's score: simulate it again under small variations of physics.

    Args:
        machine: The machine; an invalid one gives rollouts with status `invalid` and score 0.
        task: Level, e.g. "throwing" or "movement/3".
        knobs: Knobs of the level to change.
        engine: Physics engine; "auto" is the first that is installed.
        seed: Random seed.

    Raises:
        UsageError: The task, knob, engine or file does not exist, or the machine is a text that
            names a file.
    """
    from agentflow.env import verification

    level, report = _read(machine, task, knobs, engine)
    if report.machine is None:
        return verification.Verification.invalid(report.problems)
    return verification.verify(report.machine, level, seed=seed)


async def verify_async(
    machine: MachineLike,
    task: str,
    pool: Pool,
    *,
    knobs: Mapping[str, object] | None = None,
    engine: str = "auto",
    seed: int = 0,
) -> Verification:
    """Like `verify`, with all simulations at once in the worker processes of a pool."""
    from agentflow.env import verification

    level, report = _read(machine, task, knobs, engine)
    if report.machine is None:
        return verification.Verification.invalid(report.problems)
    run = partial(pool.run, report.machine, level, seed=seed)
    return await verification.verify_async(report.machine, level, run)


def design_prompt(
    task: str,
    *,
    knobs: Mapping[str, object] | None = None,
    engine: str = "auto",
    prompts: str = "default",
    role: str = "designer",
) -> list[dict[str, str]]:
    """The prompt that asks for a whole machine in one reply, as chat messages.

    It is the prompt of designers in a run: a system and a user message, each with `role` and
    `content`. `reward` scores the reply.

    Args:
        task: Level, e.g. "throwing" or "movement/3".
        knobs: Knobs of the level to change.
        engine: Physics engine, which limits how large a machine may be.
        prompts: Prompt set.
        role: Who is asked; `agent` is one that calls tools.

    Raises:
        UsageError: The task, knob, engine, prompt set or role does not exist.
    """
    from agentflow.agents.base import chat_prompt
    from agentflow.agents.registry import ROLES
    from agentflow.env.tasks.registry import get_task

    return chat_prompt(ROLES[role], get_task(task, knobs, engine).brief, prompts)


def _config_keys(settings: Mapping[str, object] | None, *values: object) -> dict[str, Any]:
    """The configuration keys that a call gives: settings, and the values of `_OPTIONS`."""
    given = zip(_OPTIONS, values, strict=True)
    return {**(settings or {}), **{key: value for key, value in given if value is not None}}


def _configure(
    config: Path | str | Mapping[str, Any] | None,
    given: Mapping[str, Any],
    answer: ModelFunction | None,
    trust: bool,
) -> tuple[DesignConfig, FunctionClient | None]:
    """The configuration, and the client of `answer`."""
    from agentflow.app.design.config import set_options
    from agentflow.app.design.trust import require_trust
    from agentflow.config.grid import function_name
    from agentflow.config.run import PROCEDURAL, build_config, load_document, set_key
    from agentflow.llm.function import FunctionClient
    from agentflow.models.completion import complete_config

    config = Path(config) if isinstance(config, str) else config
    document = load_document(config) if isinstance(config, Path) else dict(config or {})
    named = {} if answer is None else {"model.name": function_name(answer)}
    for key, value in {**named, **given}.items():
        document = set_key(document, key, value)
    if answer is None:
        found = complete_config(document)
        if isinstance(config, Path):
            require_trust(config, [found], set_options({}, (), given), lambda _sentence: trust)
        return found, None
    built = build_config(document)
    if built.model.name == PROCEDURAL or built.model.roles:
        raise UsageError(
            f"answer= replaces the model: use a model name other than {PROCEDURAL!r} and leave "
            "model.roles empty"
        )
    return built, FunctionClient(answer, built.model.name)


def _options_of_run(
    path: Path,
    answer: ModelFunction | None,
    trust: bool,
    say: Notify | None,
    listener: Listener | None,
    pool: Pool | None = None,
) -> RunOptions:
    """How to continue a run."""
    from agentflow.app.design.run import RunOptions
    from agentflow.config.run import build_config, load_document
    from agentflow.llm.function import FunctionClient

    client = None
    if answer is not None:
        name = build_config(load_document(path / "run.yaml")).model.name
        client = FunctionClient(answer, name)
    return RunOptions(say or _print_remark, listener, client, pool, approve=lambda _sentence: trust)


def _to_design(result: RunResult) -> Design:
    from agentflow.app.design.execution import best_machine

    data = result.to_json()
    return Design(
        run=Path(result.run),
        valid=result.valid,
        score=result.score,
        verified=result.verified_score,
        fragile=result.fragile,
        machine=best_machine(result),
        model=result.model,
        stages=tuple(data["stages"]),
        stopped=result.stopped,
        data=data,
    )


def _require_no_event_loop(name: str) -> None:
    try:
        asyncio.get_running_loop()
    except RuntimeError:
        return
    raise UsageError(f"{name} blocks until its run ends; on an event loop, await {name}_async")


def _print_remark(line: str) -> None:
    print(f"agentflow: {line}", file=sys.stderr)


def _brief_of(
    task: str | None, knobs: Mapping[str, object] | None, engine: str = "auto"
) -> Brief | None:
    """The rules of a task; None without one, which knobs must then not change."""
    if task is None:
        if knobs:
            raise UsageError("knobs change a task; name it with task=")
        return None
    from agentflow.env.tasks.registry import get_task

    return get_task(task, knobs, engine).brief


def _read(
    machine: MachineLike, task: str, knobs: Mapping[str, object] | None, engine: str
) -> tuple[Task, Report]:
    from agentflow.env.tasks.registry import get_task

    level = get_task(task, knobs, engine)
    return level, _check(machine, level.brief, level.brief.limits)


def _check(machine: MachineLike, brief: Brief | None, limits: Limits) -> Report:
    from agentflow.app.machines.files import read_source

    if isinstance(machine, Machine):
        return check_machine(machine, brief, limits)
    if isinstance(machine, Path):
        return check_machine(read_source(str(machine), brief), brief, limits)
    if isinstance(machine, str):
        _require_text(machine)
    return check_machine(read_for(brief, machine), brief, limits)


def _require_text(text: str) -> None:
    """Refuse what can only be meant as a file: the name of one, or of one that is not there."""
    if os.path.isfile(text) or re.fullmatch(r"[^\n{\[<]+\.(json|bsg)", text):
        raise UsageError(
            f"{text!r} is the name of a file, not the text of a machine: pass Path({text!r})"
        )
