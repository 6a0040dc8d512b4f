"""Commands for single machines and the block library. Importing this module registers them."""

from __future__ import annotations

from collections.abc import AsyncIterator
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from agentflow.cli.root import Engine, Json, Knobs, On, commands, print_json, print_result
from agentflow.errors import UsageError

Task = Annotated[str | None, typer.Option(help="Task, such as throwing or movement/3.")]
Seed = Annotated[int, typer.Option(help="Random seed.")]
Source = Annotated[
    str,
    typer.Argument(help="Machine file, run directory (its best machine), or - for standard input."),
]


def named_task(source: str, task: str | None, *own: object) -> str | None:
    """The task given for a machine; None for a run that is meant with its own task.

    Args:
        source: Machine file or run directory.
        task: The task given, if any.
        own: Knobs, seed and engine, which such a run has itself.

    Raises:
        UsageError: One of `own` is given for such a run, or a file has no task.
    """
    if task is not None:
        return task
    if not Path(source).is_dir():
        raise UsageError("a machine file does not name its task; add --task")
    if any(own):
        raise UsageError(
            "a run has its own task, knobs, seed and engine; remove --set, --seed and --engine, or "
            "name a task with --task"
        )
    return None


@commands.command(epilog="Example: agentflow check machine.json --task throwing --json")
def check(
    machine: Source,
    task: Task = None,
    knobs: Knobs = None,
    engine: Engine = None,
    form: Annotated[
        Literal["auto", "tree", "coordinates", "bsg"],
        typer.Option("--format", help="Input format; auto detects the format."),
    ] = "auto",
    geometry: Annotated[
        bool, typer.Option("--geometry", help="Print the position of every block.")
    ] = False,
    lines: Annotated[bool, typer.Option("--jsonl", help="Read one machine per line.")] = False,
    strict: Annotated[
        bool,
        typer.Option(
            "--strict",
            help="Exit with status 1 if there is any problem or warning, or if the text had to be "
            "repaired; with --jsonl, on any line.",
        ),
    ] = False,
    as_json: Json = False,
) -> None:
    """Check whether a machine is valid: its format, its geometry and the rules of a task.

    The exit status is 0 even for an invalid machine, unless --strict is given.
    """
    from agentflow.app.machines import files as machines
    from agentflow.cli.display.show import show_report

    brief = _brief(task, knobs, engine)
    flawless = True
    if lines:
        found = machines.read_lines(machine)
        for report in machines.check_lines(found, brief, geometry, form, engine):
            print_json(report)
            flawless &= machines.is_flawless(report)
    else:
        report = machines.check(machines.machine_text(machine), brief, geometry, form, engine)
        print_result(report, as_json, show_report)
        flawless = machines.is_flawless(report)
    if strict and not flawless:
        raise typer.Exit(1)


def _brief(task: str | None, knobs: list[str] | None, engine: str | None = None) -> Any:
    level = _task(task, knobs, engine)
    return None if level is None else level.brief


def _task(task: str | None, knobs: list[str] | None, engine: str | None) -> Any:
    if task is None:
        if knobs:
            raise UsageError("--set changes a knob of a task; name the task with --task")
        return None
    from agentflow.app.tasks import find_task

    return find_task(task, knobs or (), engine)


@commands.command(
    epilog="Example: agentflow edit machine.json --script changes.txt --task throwing"
)
def edit(
    machine: Source,
    script: Annotated[str, typer.Option(help="Script file; default: standard input.")] = "-",
    task: Task = None,
    knobs: Knobs = None,
    lines: Annotated[
        bool, typer.Option("--jsonl", help="Read one machine and one script per line.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Edit a machine with a script of Add, Remove and Move commands.

    If one command fails, the machine stays unchanged.
    """
    from agentflow.app.machines import edits
    from agentflow.app.machines import files as machines
    from agentflow.cli.display.show import show_edit

    brief = _brief(task, knobs)
    if lines:
        for outcome in edits.edit_lines(machines.read_lines(machine), brief):
            print_json(outcome)
        return
    print_result(edits.edit_file(machine, script, brief), as_json, show_edit)


@commands.command(epilog="Example: agentflow convert machine.json machine.bsg")
def convert(
    source: Source,
    out: Annotated[
        Path, typer.Argument(help="Output file: .json, .coords.json, .bsg, .glb, .urdf or .xml.")
    ],
    task: Annotated[
        str | None,
        typer.Option(help="Task whose scene an .xml file holds, such as movement/3."),
    ] = None,
    knobs: Knobs = None,
    strict: Annotated[
        bool,
        typer.Option(
            "--strict", help="Fail if any block is unsupported or the machine is invalid."
        ),
    ] = False,
    as_json: Json = False,
) -> None:
    """Convert a machine, or the best machine of a run, to another format.

    Unsupported blocks are reported and skipped; an invalid machine is written with a warning.

    Two formats are for other simulators: .urdf holds the machine alone, and .xml (MJCF, for MuJoCo)
    the machine in the scene of a task. They hold valid machines only; notes say what is lost.
    """
    from agentflow.app.machines.convert import convert as rewrite
    from agentflow.cli.display.show import show_conversion

    level = _task(task, knobs, "mujoco")
    print_result(rewrite(source, out, task=level, strict=strict), as_json, show_conversion)


@commands.command(epilog="Example: agentflow simulate machine.json --task movement --json")
def simulate(
    machine: Source,
    task: Annotated[str, typer.Option(help="Task, such as throwing or movement/3.")],
    knobs: Knobs = None,
    engine: Engine = None,
    seed: Seed = 0,
    rate: Annotated[float | None, typer.Option(help="Time steps per second; default: 120.")] = None,
    interval: Annotated[
        float | None,
        typer.Option(help="Seconds between recorded states and rows of --query; default: 0.2."),
    ] = None,
    power: Annotated[
        Literal["on", "off"],
        typer.Option(help="If off, motors, springs and winches never start."),
    ] = "on",
    query: Annotated[
        list[str] | None,
        typer.Option(
            help="Report recorded states of one block: JSON with its id, a time interval "
            "(duration) and properties, such as "
            '{"id": 3, "duration": [0, 1], "properties": ["position"]}; repeatable.'
        ),
    ] = None,
    save: Annotated[
        Path | None, typer.Option(help="Save the recorded states to this .npz file.")
    ] = None,
    lines: Annotated[bool, typer.Option("--jsonl", help="Read one machine per line.")] = False,
    workers: Annotated[
        int, typer.Option(min=1, help="Worker processes, for trials and with --jsonl.")
    ] = 2,
    on: On = "local",
    as_json: Json = False,
) -> None:
    """Simulate a machine on a task and print its score."""
    from agentflow.app.machines import files as machines
    from agentflow.app.machines import simulate as rollouts
    from agentflow.app.pools import pools_on
    from agentflow.app.tasks import find_task
    from agentflow.cli.display.show import show_rollout
    from agentflow.cli.display.text import show_count

    level, powered = find_task(task, knobs or (), engine), power == "on"
    if lines:
        if save:
            raise UsageError("--save needs a single machine; remove --jsonl")
        results = rollouts.simulate_lines(
            machines.read_lines(machine),
            level,
            seed=seed,
            rate=rate,
            power=powered,
            interval=interval,
            workers=workers,
            queries=query or (),
            open_pool=pools_on(on),
        )
        _print_all(results)
        return
    if on != "local":
        raise UsageError(f"--on {on} is for many machines: add --jsonl, or remove --on")
    result = rollouts.simulate_text(
        machines.machine_text(machine),
        level,
        seed=seed,
        rate=rate,
        power=powered,
        interval=interval,
        workers=workers,
        say=show_count("trial"),
        queries=query or (),
        save=save,
    )
    print_result(result, as_json, show_rollout)


def _print_all(results: AsyncIterator[Any]) -> None:
    import asyncio

    async def print_each() -> None:
        async for result in results:
            print_json(result)

    asyncio.run(print_each())


@commands.command(epilog="Example: agentflow render car.json --task movement --out car.mp4")
def render(
    source: Annotated[str, typer.Argument(help="Run directory or machine file.")],
    task: Task = None,
    knobs: Knobs = None,
    engine: Engine = None,
    seed: Seed = 0,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Output file: .png, .gif, .mp4 or .glb. Without an extension, both a .png and a "
            ".gif are written."
        ),
    ] = None,
    view: Annotated[
        str,
        typer.Option(
            help="Viewpoint: front, back, left, right, top, three-quarter or sheet (all six)."
        ),
    ] = "three-quarter",
) -> None:
    """Draw a machine (.png), film its simulation (.gif, .mp4) or export it in 3D (.glb).

    A dotted line marks the path of the boulder or of the root block; blocks that broke off are
    red. An invalid machine can only be drawn; the blocks that overlap are red.
    """
    from agentflow.app.design.plan import level_note
    from agentflow.app.pages.pictures import render_file, render_run
    from agentflow.app.tasks import find_task
    from agentflow.cli.display.live import print_line
    from agentflow.cli.display.text import show_count
    from agentflow.runs import read_document, state_of

    say = show_count("trial")
    if Path(source).is_dir():
        state_of(Path(source))  # raises for a directory that is not a run
        if task is not None or knobs or seed:
            raise UsageError("a run has its own task and seed; remove --task, --set and --seed")
        files = render_run(Path(source), out, view, say, engine)
        if note := level_note(Path(source), read_document(Path(source))):
            print_line(f"agentflow: {note}")
    else:
        level = find_task(task or "movement", knobs or (), engine)
        files = render_file(
            source,
            level,
            seed,
            out or Path("machine"),
            view,
            say,
            lambda line: print_line(f"agentflow: {line}"),
        )
    for path in files.values():
        print(path)


@commands.command(epilog="Example: agentflow blocks 63")
def blocks(
    name: Annotated[str | None, typer.Argument(help="A block's type id or name.")] = None,
    picture: Annotated[
        Path | None,
        typer.Option(
            help="Draw the block with numbered faces and axes to this .png file; without a block, "
            "draw all blocks to this directory."
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """List all blocks, or show one block and its faces."""
    from agentflow.app.machines.files import find_block, list_blocks
    from agentflow.cli.display.show import show_block, show_blocks

    if picture is not None:
        from agentflow.app.pages.blocks import draw_all, draw_named

        for path in draw_all(picture) if name is None else [draw_named(name, picture)]:
            print(path)
    elif name is None:
        print_result(list_blocks(), as_json, show_blocks)
    else:
        print_result(find_block(name), as_json, show_block)
