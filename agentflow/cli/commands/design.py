"""The commands that ask models: design, replay, doctor. Importing it adds them to the others."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Literal

import typer

from agentflow.cli.root import (
    BaseUrl,
    Config,
    Json,
    ModelName,
    Quiet,
    Run,
    Settings,
    commands,
    print_json,
)
from agentflow.errors import EndpointError, UsageError


@commands.command(
    epilog="Example: agentflow design --task movement --workflow hierarchical --seed 3"
)
def design(
    task: Annotated[str | None, typer.Option(help="Task, for instance throwing.")] = None,
    workflow: Annotated[
        str | None,
        typer.Option(
            help="single, iterative, hierarchical, random-dsl; placement or random-placement for "
            "placement tasks."
        ),
    ] = None,
    model: ModelName = None,
    base_url: BaseUrl = None,
    config: Config = None,
    settings: Settings = None,
    seed: Annotated[int | None, typer.Option(help="Of everything left to chance.")] = None,
    rationale_from: Annotated[
        str | None, typer.Option(help="Run whose designers' plans are to be followed.")
    ] = None,
    rollouts: Annotated[
        int | None, typer.Option(help="Simulations of the whole run, for random-dsl.")
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder that holds run directories.")] = Path("runs"),
    workers: Annotated[int | None, typer.Option(help="Processes for rollouts.")] = None,
    keep_rollouts: Annotated[
        Literal["winners", "all"] | None,
        typer.Option(help="Whose states to keep: of each stage's best machine, or of all."),
    ] = None,
    resume: Annotated[Path | None, typer.Option(help="Run directory to continue.")] = None,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Design a machine: from a task to the best machine found, and pictures of it.

    A finished run that is resumed gives its result and changes no file.
    """
    from agentflow.app.design.design import design as start
    from agentflow.app.design.design import resume as go_on
    from agentflow.app.design.models import configured
    from agentflow.app.pages.pictures import render_run
    from agentflow.cli.display.live import DRAWING, watch
    from agentflow.cli.display.show import show_result
    from agentflow.runs import Event, state_of

    options = {
        "task": task,
        "workflow": workflow,
        "seed": seed,
        "workers": workers,
        "model.name": model,
        "model.base_url": base_url,
        "rationale_from": rationale_from,
        "settings.rollouts": rollouts,
        "keep_rollouts": keep_rollouts,
    }
    given = [name for name, value in options.items() if value is not None]
    if resume is not None and (given or config or settings):
        raise UsageError("--resume continues a run as it was begun; leave out the other options")
    finished = resume is not None and state_of(resume) == "done"
    with watch(quiet) as (listener, say):
        if resume is not None:
            result = go_on(resume, say, listener)
        else:
            built = configured(config, settings or (), options)
            if rollouts is not None and built.workflow != "random-dsl":
                raise UsageError(
                    "--rollouts is for --workflow random-dsl; others take --set search.rounds=N "
                    "and --set trajectories=N"
                )
            result = start(built, out, say, listener)
        drawn = result["valid"] and not finished
        if drawn and listener is not None:
            listener(Event(DRAWING, "best", {}))
        pictures = render_run(Path(result["run"])) if drawn else {}
    if as_json:
        print_json(result)
    else:
        show_result(result, pictures)


@commands.command(epilog="Example: agentflow replay runs/recorded-throwing")
def replay(run: Run) -> None:
    """Repeat a run from its record and compare everything: `identical` or the first difference."""
    from agentflow.app.design.replay import replay as repeat

    difference = repeat(run, lambda line: print(f"agentflow: {line}", file=sys.stderr))
    print(difference or "identical")
    raise typer.Exit(1 if difference else 0)


@commands.command(
    epilog="Example: agentflow doctor --model qwen3 --base-url http://127.0.0.1:8000/v1"
)
def doctor(
    model: Annotated[str | None, typer.Option(help="Model name; or AGENTFLOW_MODEL.")] = None,
    base_url: Annotated[str | None, typer.Option(help="Endpoint; or OPENAI_BASE_URL.")] = None,
    config: Config = None,
    settings: Settings = None,
    role: Annotated[
        str, typer.Option(help="Whose model, where roles have their own.")
    ] = "designer",
    as_json: Json = False,
) -> None:
    """Send one tiny request to a model's endpoint and report what it can do."""
    from agentflow.app.design.models import configured
    from agentflow.app.doctor import examine
    from agentflow.cli.display.show import show_diagnosis

    options = {"model.name": model, "model.base_url": base_url}
    found = examine(configured(config, settings or (), options), role).model_dump()
    print_json(found) if as_json else show_diagnosis(found)
    if found["problem"]:
        raise EndpointError(found["problem"])
