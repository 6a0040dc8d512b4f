"""Commands that call models: design, replay, doctor. Importing this module registers them."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated, Literal

import typer

from agentflow.cli import options
from agentflow.cli.root import PARTLY, allow, approve, commands, print_json, print_result
from agentflow.errors import EndpointError, UsageError
from agentflow.workflows.registry import WORKFLOWS

LONGEST_NAME = 255
"""Bytes of a directory's name on common file systems."""
OPTION_OF = {
    "model.name": "--model",
    "model.base_url": "--base-url",
    "settings.start": "--start",
    "settings.brief": "--brief",
    "settings.sketch": "--sketch",
    "settings.max_simulations": "--rollouts",
}
"""Configuration key -> the option that sets it, where their names differ."""


@commands.command(
    epilog="Example: agentflow design --task movement --workflow hierarchical --seed 3"
)
def design(
    task: options.Task = None,
    workflow: Annotated[
        str | None,
        typer.Option(help=f"Workflow: {', '.join(WORKFLOWS.ours)}. The last two are for gearing."),
    ] = None,
    model: options.ModelName = None,
    base_url: options.BaseUrl = None,
    config: options.Config = None,
    settings: options.Settings = None,
    engine: options.Engine = None,
    seed: options.RunSeed = None,
    seeds: Annotated[int | None, typer.Option(min=1)] = None,
    minutes: Annotated[float | None, typer.Option(min=0)] = None,
    start: str | None = None,
    brief: str | None = None,
    sketch: str | None = None,
    rationale_from: str | None = None,
    lessons: Path | None = None,
    rollouts: Annotated[int | None, typer.Option(min=1)] = None,
    out: options.RunsFolder = Path("runs"),
    name: str | None = None,
    workers: Annotated[int | None, typer.Option(help=options.WORKERS)] = None,
    backend: options.Backend = "local",
    keep_rollouts: Literal["best", "all"] | None = None,
    resume: Path | None = None,
    trust: options.Trust = False,
    quiet: options.Quiet = False,
    as_json: options.Json = False,
) -> None:
    """Design a machine for a task and draw the best one found.

    Resuming a finished run prints its result, and draws its pictures if they are missing.

    Args:
        seeds: Make this many runs, with seeds from --seed on; report the best.
        minutes: With --seeds: start no more runs after this many minutes.
        start: Machine file or run directory: improve this machine instead of designing one.
        brief: Your wishes, added to the task: "a machine that ...".
        sketch: PNG file with your sketch, for a model that sees pictures.
        rationale_from: Reuse the designers' rationales from this run directory.
        lessons: Show designers and refiners what earlier runs at the task have written in this file
            (JSON lines), and add what this run learns.
        rollouts: Maximum number of simulations of the run, verification not counted.
        name: Name of the run directory; default: date, task, workflow and seed.
        keep_rollouts: Which rollouts to save: those of each stage's best machine, or all.
        resume: Run directory to resume.
    """
    from agentflow.app.design import run
    from agentflow.app.design.config import load_config
    from agentflow.app.design.execution import machine_file
    from agentflow.app.design.plan import RunPlan
    from agentflow.app.design.seeds import SeedsResult, design_seeds
    from agentflow.app.design.trust import require_trusted_run
    from agentflow.app.inspect.overview import reached
    from agentflow.app.machines.files import read_one
    from agentflow.app.pages.pictures import draw_missing
    from agentflow.app.pools import pools_on
    from agentflow.app.sweeps.estimates import estimate
    from agentflow.cli.display.live import watch
    from agentflow.cli.display.show_runs import show_result
    from agentflow.holding import with_holding
    from agentflow.runs import RunResult, read_document, state_of

    keys = {
        "task": task,
        "workflow": workflow,
        "engine": engine,
        "seed": seed,
        "workers": workers,
        "model.name": model,
        "model.base_url": base_url,
        "settings.start": None if start is None else read_one(start).to_json(),
        "settings.brief": brief,
        "settings.sketch": sketch,
        "rationale_from": rationale_from,
        "settings.max_simulations": rollouts,
        "keep_rollouts": keep_rollouts,
    }
    if name is not None:
        _check_name(name, seeds)
    others: dict[str, object] = {"seeds": seeds, "name": name, "lessons": lessons, "config": config}
    others["set"] = settings or None
    given = [option for option, value in {**keys, **others}.items() if value is not None]
    if resume is not None and given:
        raise UsageError(
            "--resume uses the settings of the run; remove the other options: "
            + ", ".join(OPTION_OF.get(key, "--" + key.replace("_", "-")) for key in given)
        )
    if minutes is not None and seeds is None:
        raise UsageError("--minutes limits the runs of --seeds; give their number, as in --seeds 5")
    finished = resume is not None and state_of(resume) == "done"
    open_pool = pools_on(backend)
    allowed = allow if trust else approve  # asks before the progress display starts
    carry_out: Callable[[run.RunOptions], RunResult | SeedsResult]
    calls = 0
    if resume is not None:
        if not finished:
            require_trusted_run(resume, allowed, {})
        carry_out = partial(run.resume, resume)
    else:
        built = load_config(config, settings or (), keys, allowed)
        calls = estimate(RunPlan.of(built)).calls
        carry_out = partial(run.design, built, out, name=name or "")
        if seeds is not None:
            carry_out = partial(design_seeds, built, out, seeds, minutes)
    with watch(quiet, calls) as (listener, notify):
        found = carry_out(
            run.RunOptions(notify, listener, approve=allow, open_pool=open_pool, lessons=lessons)
        )
        best, rows = (found.best, found.rows) if isinstance(found, SeedsResult) else (found, ())
        path, told = Path(best.run), notify if finished else None
        pictures = draw_missing(path, listener, told) if best.valid else {}
    data = found.to_json()
    data["verified"] = with_holding(data.get("verified"))
    if as_json:
        print_json(data)
    else:
        record = reached(path, read_document(path), best.trusted_score)
        show_result({**data, "record": record}, {**machine_file(best), **pictures})
    if any(row["failed"] for row in rows):
        raise typer.Exit(PARTLY)


@commands.command(epilog="Example: agentflow tune machine.json --task transport --simulations 60")
def tune(
    machine: options.MachineOrRun,
    task: options.NamedTask,
    simulations: Annotated[int, typer.Option(min=2)] = 100,
    knobs: options.Knobs = None,
    engine: options.Engine = None,
    seed: options.RunSeed = None,
    out: options.RunsFolder = Path("runs"),
    name: str | None = None,
    workers: Annotated[int | None, typer.Option(help=options.WORKERS)] = None,
    backend: options.Backend = "local",
    quiet: options.Quiet = False,
    as_json: options.Json = False,
) -> None:
    """Improve the numbers of a machine's controls (times, levels, gains) by CMA-ES.

    Blocks stay as they are. This is a run like others, which `agentflow design --resume` continues.

    Args:
        simulations: Number of simulations, the first of the machine included.
        name: Name of the run directory; default: date, task, workflow and seed.
    """
    design(
        task=task,
        workflow="tune",
        start=machine,
        rollouts=simulations,
        settings=knobs,
        engine=engine,
        seed=seed,
        out=out,
        name=name,
        workers=workers,
        backend=backend,
        quiet=quiet,
        as_json=as_json,
    )


def _check_name(name: str, seeds: int | None) -> None:
    if (size := len(name.encode())) > LONGEST_NAME:
        raise UsageError(
            f"--name has {size} bytes, and names of directories at most {LONGEST_NAME}: choose a "
            "shorter one"
        )
    if seeds is not None or Path(name).name != name or name.startswith("."):
        raise UsageError("--name takes the name of one directory, without slashes, for one run")


@commands.command(epilog="Example: agentflow replay runs/recorded-throwing")
def replay(run: options.Run) -> None:
    """Replay a run from its recording; print `identical` or the first difference."""
    from agentflow.app.design.replay import replay as repeat
    from agentflow.cli.display.live import print_remark

    difference = repeat(run, print_remark)
    print(difference or "identical")
    raise typer.Exit(1 if difference else 0)


@commands.command(
    epilog="Example: agentflow doctor --model qwen3 --base-url http://127.0.0.1:8000/v1"
)
def doctor(
    model: str | None = None,
    base_url: options.BaseUrl = None,
    config: options.Config = None,
    settings: options.Settings = None,
    role: str = "designer",
    sandbox: bool = False,
    trust: options.Trust = False,
    as_json: options.Json = False,
) -> None:
    """Ask a model endpoint for one small machine, and report what works.

    Args:
        model: Model name; default: value of AGENTFLOW_MODEL.
        role: Check the model of this role; agent: that it calls tools.
        sandbox: Only tell whether agent programs run isolated here.
    """
    if sandbox:
        from agentflow.integrations.external.sandbox import sandbox_problem

        why = sandbox_problem()
        told = f"agent programs run {'not isolated: ' * bool(why)}{why or 'isolated'}"
        print_result({"isolated": not why, "reason": why}, as_json, lambda _: print(told))
        return
    from agentflow.app.design.config import load_config
    from agentflow.app.doctor import check_endpoint
    from agentflow.cli.display.show_machines import show_diagnosis

    keys = {"model.name": model, "model.base_url": base_url}
    allowed = allow if trust else approve
    found = check_endpoint(load_config(config, settings or (), keys, allowed), role)
    print_result(found, as_json, show_diagnosis)
    if found["problem"]:
        raise EndpointError(found["problem"])
