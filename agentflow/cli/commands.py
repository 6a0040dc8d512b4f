"""Owns the commands and their options. Heavy imports happen inside the commands that need them."""

from __future__ import annotations

import json
import sys
from collections.abc import AsyncIterator, Mapping
from math import isfinite
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from agentflow import __version__
from agentflow.errors import UsageError

commands = typer.Typer(
    name="agentflow",
    help="Language models design machines; physics decides whether they work.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)

Task = Annotated[str | None, typer.Option(help="Task, for instance throwing or movement.")]
Knobs = Annotated[list[str] | None, typer.Option("--set", help="knob=value of the task.")]
Json = Annotated[bool, typer.Option("--json", help="Print JSON and nothing else on stdout.")]
Seed = Annotated[int, typer.Option(help="Of everything left to chance.")]
Source = Annotated[str, typer.Argument(help="Machine file, or - for standard input.")]
Run = Annotated[Path, typer.Argument(help="Run directory.")]
Config = Annotated[Path | None, typer.Option(help="YAML file with any of the keys.")]
Settings = Annotated[
    list[str] | None,
    typer.Option("--set", help="key=value of the configuration, or knob=value of the task."),
]
Power = Annotated[Literal["on", "off"], typer.Option(help="off: nothing is ever switched on.")]


def _version(wanted: bool) -> None:
    if wanted:
        print(f"agentflow {__version__}")
        raise typer.Exit


@commands.callback()
def common(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show tracebacks of errors.")] = False,
) -> None:
    """Options of all commands; `--debug` is read in cli.main, wherever it stands."""


def _print_json(value: Any) -> None:
    """One line of JSON, at once: who reads lines may wait for each. ASCII, for any terminal."""
    print(json.dumps(_finite(value), allow_nan=False), flush=True)


def _finite(value: Any) -> Any:
    """The value with null for every number that JSON does not know."""
    if isinstance(value, float) and not isfinite(value):
        return None
    if isinstance(value, Mapping):
        return {key: _finite(item) for key, item in value.items()}
    return [_finite(item) for item in value] if isinstance(value, list | tuple) else value


@commands.command(
    epilog="Example: agentflow design --task movement --workflow hierarchical --seed 3"
)
def design(
    task: Annotated[str | None, typer.Option(help="Task, for instance throwing.")] = None,
    workflow: Annotated[
        str | None, typer.Option(help="hierarchical, iterative, single or random-dsl.")
    ] = None,
    model: Annotated[
        str | None, typer.Option(help="Model name; without one, rules and chance answer.")
    ] = None,
    base_url: Annotated[
        str | None, typer.Option(help="OpenAI-compatible endpoint; the key is OPENAI_API_KEY.")
    ] = None,
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
    quiet: Annotated[bool, typer.Option("--quiet", help="Show no progress.")] = False,
    as_json: Json = False,
) -> None:
    """Design a machine: from a task to the best machine found, and pictures of it."""
    from agentflow.app.pages.pictures import render_run
    from agentflow.app.runs.design import design as start
    from agentflow.app.runs.design import resume as go_on
    from agentflow.app.runs.models import configured
    from agentflow.cli.live import DRAWING, watch
    from agentflow.cli.show import show_result
    from agentflow.runs import Event

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
    with watch(quiet) as (listener, say):
        if resume is not None:
            result = go_on(resume, say, listener)
        else:
            result = start(configured(config, settings or (), options), out, say, listener)
        if listener is not None and result["valid"]:
            listener(Event(DRAWING, "best", {}))
        pictures = render_run(Path(result["run"])) if result["valid"] else {}
    if as_json:
        _print_json(result)
    else:
        show_result(result, pictures)


@commands.command(epilog="Example: agentflow replay runs/recorded-throwing")
def replay(run: Run) -> None:
    """Repeat a run from its record and compare everything: `identical` or the first difference."""
    from agentflow.app.runs.replay import replay as repeat

    difference = repeat(run, lambda line: print(f"agentflow: {line}", file=sys.stderr))
    print(difference or "identical")
    raise typer.Exit(1 if difference else 0)


@commands.command(epilog="Example: agentflow check machine.json --task throwing --json")
def check(
    machine: Source,
    task: Task = None,
    knobs: Knobs = None,
    form: Annotated[
        Literal["auto", "tree", "coordinates", "bsg"],
        typer.Option("--format", help="How the machine is written; auto finds out."),
    ] = "auto",
    geometry: Annotated[bool, typer.Option("--geometry", help="Where every block is.")] = False,
    lines: Annotated[bool, typer.Option("--jsonl", help="One machine per line.")] = False,
    as_json: Json = False,
) -> None:
    """Judge a machine: file, space, and what a task demands."""
    from agentflow.app.machines import files as machines
    from agentflow.cli.show import show_report

    brief = _brief(task, knobs)
    if lines:
        source = machines.read_lines(machine)
        for report in machines.check_lines(source, brief, geometry, form):
            _print_json(report)
        return
    text = machines.machine_text(machine)
    report = machines.check(text, brief, geometry, form)
    if as_json:
        _print_json(report)
    else:
        show_report(report, machines.warnings(text, brief, form))


def _brief(task: str | None, knobs: list[str] | None) -> Any:
    if task is None:
        if knobs:
            raise UsageError("--set changes a task; name it with --task")
        return None
    from agentflow.app.tasks import find_task

    return find_task(task, knobs or ()).brief


@commands.command(
    epilog="Example: agentflow edit machine.json --script changes.txt --task throwing"
)
def edit(
    machine: Source,
    script: Annotated[
        str, typer.Option(help="File of commands; standard input when not given.")
    ] = "-",
    task: Task = None,
    knobs: Knobs = None,
    lines: Annotated[bool, typer.Option("--jsonl", help="Machine and script per line.")] = False,
    as_json: Json = False,
) -> None:
    """Change a machine by a script of Add, Remove and Move commands, all or nothing."""
    from agentflow.app.machines import edits
    from agentflow.app.machines import files as machines
    from agentflow.cli.show import show_edit

    brief = _brief(task, knobs)
    if lines:
        for outcome in edits.edit_lines(machines.read_lines(machine), brief):
            _print_json(outcome)
        return
    outcome = edits.edit_file(machine, script, brief)
    if as_json:
        _print_json(outcome)
    else:
        show_edit(outcome)


@commands.command(epilog="Example: agentflow convert machine.json machine.bsg")
def convert(
    source: Source,
    out: Annotated[Path, typer.Argument(help="File to write: .json, .coords.json, .bsg or .glb.")],
    strict: Annotated[
        bool, typer.Option("--strict", help="Refuse a machine when a block must be left out.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Write a machine in another form. Blocks that cannot be taken over are named and left out."""
    from agentflow.app.machines.convert import convert as rewrite
    from agentflow.cli.show import show_conversion

    result = rewrite(source, out, strict=strict)
    if as_json:
        _print_json(result)
    else:
        show_conversion(result)


@commands.command(epilog="Example: agentflow simulate machine.json --task movement --json")
def simulate(
    machine: Source,
    task: Annotated[str, typer.Option(help="Task, for instance throwing or movement.")],
    knobs: Knobs = None,
    seed: Seed = 0,
    rate: Annotated[float | None, typer.Option(help="Steps per second.")] = None,
    power: Power = "on",
    query: Annotated[
        list[str] | None, typer.Option(help="JSON: id, duration and properties of a block.")
    ] = None,
    save: Annotated[Path | None, typer.Option(help="Keep the states in this .npz file.")] = None,
    lines: Annotated[bool, typer.Option("--jsonl", help="One machine per line.")] = False,
    workers: Annotated[int, typer.Option(min=1, help="Processes, with --jsonl.")] = 2,
    as_json: Json = False,
) -> None:
    """Build a machine, let physics run, and score it."""
    from agentflow.app.machines import files as machines
    from agentflow.app.machines import simulate as rollouts
    from agentflow.app.tasks import find_task
    from agentflow.cli.show import show_rollout

    level, on = find_task(task, knobs or ()), power == "on"
    if lines:
        if query or save:
            raise UsageError("--query and --save take one machine; leave out --jsonl")
        source = machines.read_lines(machine)
        results = rollouts.simulate_lines(
            source, level, seed=seed, rate=rate, power=on, workers=workers
        )
        _print_all(results)
        return
    result = rollouts.simulate_text(
        machines.machine_text(machine),
        level,
        seed=seed,
        rate=rate,
        power=on,
        queries=query or (),
        save=save,
    )
    if as_json:
        _print_json(result)
    else:
        show_rollout(result)


def _print_all(results: AsyncIterator[Any]) -> None:
    import asyncio

    async def each() -> None:
        async for result in results:
            _print_json(result)

    asyncio.run(each())


@commands.command(epilog="Example: agentflow render car.json --task movement --out car.mp4")
def render(
    source: Annotated[str, typer.Argument(help="Run directory or machine file.")],
    task: Task = None,
    knobs: Knobs = None,
    seed: Seed = 0,
    out: Annotated[
        Path | None,
        typer.Option(help=".png, .gif, .mp4 or .glb; without ending, both .png and .gif."),
    ] = None,
    view: Annotated[
        str, typer.Option(help="front, back, left, right, top, three-quarter or sheet (all six).")
    ] = "three-quarter",
) -> None:
    """Draw a machine (.png), film its rollout (.gif, .mp4), or keep it in three dimensions (.glb).

    The projectile's or the root's path is marked, broken blocks are red.
    """
    from agentflow.app.pages.pictures import render_file, render_run
    from agentflow.app.tasks import find_task

    if Path(source).is_dir():
        if task is not None or knobs or seed:
            raise UsageError("a run has its own task and seed; leave out --task, --set and --seed")
        files = render_run(Path(source), out, view)
    else:
        level = find_task(task or "movement", knobs or ())
        files = render_file(source, level, seed, out or Path("machine"), view)
    for path in files.values():
        print(path)


@commands.command(epilog="Example: agentflow blocks 63")
def blocks(
    name: Annotated[str | None, typer.Argument(help="Type id or name of one block.")] = None,
    as_json: Json = False,
) -> None:
    """List the block library, or show one block with its faces."""
    from agentflow.app.machines.files import block_list, find_block
    from agentflow.cli.show import show_block, show_blocks

    if name is None:
        found = block_list()
        _print_json(found) if as_json else show_blocks(found)
    else:
        block = find_block(name)
        _print_json(block) if as_json else show_block(block)


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
    from agentflow.app.doctor import examine
    from agentflow.app.runs.models import configured
    from agentflow.cli.show import show_diagnosis
    from agentflow.errors import EndpointError

    options = {"model.name": model, "model.base_url": base_url}
    found = examine(configured(config, settings or (), options), role).model_dump()
    _print_json(found) if as_json else show_diagnosis(found)
    if found["problem"]:
        raise EndpointError(found["problem"])
