"""The commands on single machines and their blocks, from check to simulate.

Importing it adds them to the others.
"""

from __future__ import annotations

from collections.abc import AsyncIterator
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from agentflow.cli.root import Json, Knobs, commands, print_json
from agentflow.errors import UsageError

Task = Annotated[str | None, typer.Option(help="Task, for instance throwing or movement.")]
Seed = Annotated[int, typer.Option(help="Of everything left to chance.")]
Source = Annotated[str, typer.Argument(help="Machine file, or - for standard input.")]
Power = Annotated[Literal["on", "off"], typer.Option(help="off: nothing is ever switched on.")]


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
    from agentflow.cli.display.show import show_report

    brief = _brief(task, knobs)
    if lines:
        source = machines.read_lines(machine)
        for report in machines.check_lines(source, brief, geometry, form):
            print_json(report)
        return
    text = machines.machine_text(machine)
    report = machines.check(text, brief, geometry, form)
    if as_json:
        print_json(report)
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
    from agentflow.cli.display.show import show_edit

    brief = _brief(task, knobs)
    if lines:
        for outcome in edits.edit_lines(machines.read_lines(machine), brief):
            print_json(outcome)
        return
    outcome = edits.edit_file(machine, script, brief)
    if as_json:
        print_json(outcome)
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
    from agentflow.cli.display.show import show_conversion

    result = rewrite(source, out, strict=strict)
    if as_json:
        print_json(result)
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
    from agentflow.cli.display.show import show_rollout

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
        print_json(result)
    else:
        show_rollout(result)


def _print_all(results: AsyncIterator[Any]) -> None:
    import asyncio

    async def each() -> None:
        async for result in results:
            print_json(result)

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
    from agentflow.runs import state_of

    if Path(source).is_dir():
        state_of(Path(source))  # refuses a folder that is no run
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
    from agentflow.cli.display.show import show_block, show_blocks

    if name is None:
        found = block_list()
        print_json(found) if as_json else show_blocks(found)
    else:
        block = find_block(name)
        print_json(block) if as_json else show_block(block)
