"""Commands for single machines and the block library. Importing this module registers them."""

from collections.abc import AsyncIterator
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from agentflow.cli import options
from agentflow.cli.root import commands, level_of, print_json, print_result
from agentflow.errors import UsageError

InputFormat = Literal["auto", "tree", "coordinates", "bsg"]


@commands.command(epilog="Example: agentflow check machine.json --task throwing --json")
def check(
    machine: options.MachineOrRun,
    task: options.Task = None,
    knobs: options.Knobs = None,
    engine: options.Engine = None,
    form: Annotated[InputFormat, typer.Option("--format")] = "auto",
    geometry: bool = False,
    lines: options.Lines = False,
    strict: bool = False,
    as_json: options.Json = False,
) -> None:
    """Check whether a machine is valid: its format, its geometry and the rules of a task.

    The exit status is 0 even for an invalid machine, unless --strict is given.

    Args:
        form: Input format; auto detects the format.
        geometry: Print the position of every block.
        strict: Exit with status 1 if there is any problem or warning, or if the text had to be
            repaired; with --jsonl, if this holds for any line.
    """
    from agentflow.app.machines import files as machines
    from agentflow.cli.display.show_machines import show_report
    from agentflow.machine.formats.detect import read_lines

    brief = _brief(task, knobs, engine)
    flawless = True
    if lines:
        for line in read_lines(machine):  # one that is not JSON is checked as model text
            report = machines.check(machines.parse_line(line), brief, geometry, form, engine)
            print_json(report)
            flawless &= machines.is_flawless(report)
    else:
        report = machines.check(machines.machine_text(machine), brief, geometry, form, engine)
        print_result(report, as_json, show_report)
        flawless = machines.is_flawless(report)
    if strict and not flawless:
        raise typer.Exit(1)


def _brief(task: str | None, knobs: list[str] | None, engine: str | None = None) -> Any:
    level = level_of(task, knobs, engine)
    return None if level is None else level.brief


@commands.command(
    epilog="Example: agentflow edit machine.json --script changes.txt --task throwing"
)
def edit(
    machine: options.MachineOrRun,
    script: str = "-",
    task: options.Task = None,
    knobs: options.Knobs = None,
    out: Path | None = None,
    lines: Annotated[bool, typer.Option("--jsonl")] = False,
    as_json: options.Json = False,
) -> None:
    """Edit a machine with a script of commands, such as Add, Move and Replace.

    If one command fails, the machine stays unchanged, and no file is written. The exit status is 0
    even then; --json says whether all commands succeeded.

    Args:
        script: Script file; default: standard input.
        out: Write the edited machine to this .json file.
        lines: Read one machine and one script per line.
    """
    from agentflow.app.machines import edits
    from agentflow.cli.display.show_machines import show_edit
    from agentflow.machine.formats.detect import read_lines

    brief = _brief(task, knobs)
    if lines:
        if out:
            raise UsageError("--out needs a single machine; remove --jsonl")
        for line in read_lines(machine):
            print_json(edits.edit_line(line, brief))
        return
    outcome = edits.edit_file(machine, script, brief, out)
    print_result(outcome, as_json, lambda found: show_edit(found, out))


@commands.command(epilog="Example: agentflow convert machine.json machine.bsg")
def convert(
    source: options.MachineOrRun,
    out: Path,
    task: str | None = None,
    knobs: options.Knobs = None,
    scale: float | None = None,
    parts: bool = False,
    pegs: str | None = None,
    strict: bool = False,
    as_json: options.Json = False,
) -> None:
    """Convert a machine, or the best machine of a run, to another format.

    Unsupported blocks are reported and skipped; an invalid machine is written with a warning.

    Two formats are for other simulators: .urdf holds the machine alone, and .xml (MJCF, for MuJoCo)
    the machine in the scene of a task. Four are for making it: .step for CAD programs, .stl and
    .3mf for 3D printers, .usda for films and renderers. All six hold valid machines only; notes say
    what is lost.

    Args:
        out: Output file: .json, .coords.json, .bsg, .glb, .urdf, .xml, .step, .stl, .3mf or .usda.
        task: Task whose scene an .xml file holds, such as movement/3; default: that of the run.
        scale: N of 1 : N, for what is made (default: 20 for .stl and .3mf, 1 for .step and .usda).
        parts: Print each block as a part of its own (.stl, .3mf).
        pegs: Print parts with pegs and holes where they join; their diameter, such as 5mm.
        strict: Fail if any block is unsupported or the machine is invalid.
    """
    from agentflow.app.machines.convert import Wishes, format_of
    from agentflow.app.machines.convert import convert as rewrite
    from agentflow.app.subjects.subject import Subject
    from agentflow.cli.display.show_machines import show_conversion
    from agentflow.making.parts import making

    level = level_of(task, knobs, "mujoco")
    if level is None and format_of(out).needs == "task" and Path(source).is_dir():
        level = Subject.of_run(Path(source)).on("mujoco").task
    wishes = Wishes(level, making(scale, pegs, parts=parts))
    print_result(rewrite(source, out, wishes, strict=strict), as_json, show_conversion)


@commands.command(epilog="Example: agentflow bom machine.json --out bom.csv")
def bom(
    machine: options.MachineOrRun, out: Path | None = None, as_json: options.Json = False
) -> None:
    """List the parts of a machine: how many of which blocks, their sizes and masses.

    Args:
        out: Write the list to this .csv or .md file.
    """
    from agentflow.app.machines.convert import list_parts
    from agentflow.cli.display.show_machines import show_parts

    print_result(list_parts(machine, out), as_json, show_parts)


@commands.command(epilog="Example: agentflow instructions machine.json --out guide.html")
def instructions(
    machine: options.MachineOrRun,
    out: Annotated[Path, typer.Option()],
    as_json: options.Json = False,
) -> None:
    """Show step by step how a machine is put together, as a page to read or print.

    Blocks come in an order in which each slides onto its face past those that are there already.

    Args:
        out: Write the page to this .html file.
    """
    from agentflow.app.machines.convert import write_guide
    from agentflow.cli.display.show_machines import show_guide

    print_result(write_guide(machine, out), as_json, show_guide)


@commands.command(epilog="Example: agentflow simulate machine.json --task movement --json")
def simulate(
    machine: options.MachineOrRun,
    task: options.Task = None,
    knobs: options.Knobs = None,
    engine: options.Engine = None,
    seed: options.Seed = 0,
    rate: float | None = None,
    interval: float | None = None,
    power: Literal["on", "off"] = "on",
    query: list[str] | None = None,
    save: Path | None = None,
    lines: options.Lines = False,
    workers: Annotated[int, typer.Option(min=1)] = 2,
    backend: options.Backend = "local",
    as_json: options.Json = False,
) -> None:
    """Simulate a machine on a task and print its score.

    Without --task, the best machine of a run is simulated on its own task.

    Args:
        rate: Time steps per second; default: 120.
        interval: Seconds between recorded states and rows of --query; default: 0.2.
        power: If off, motors, springs and winches never start.
        query: Report recorded states of one block: JSON with its id, a time interval (duration) and
            properties, such as {"id": 3, "duration": [0, 1], "properties": ["position"]};
            repeatable.
        save: Save the recorded states to this .npz file.
        workers: Worker processes, for trials and with --jsonl.
    """
    from agentflow.app.pools import pools_on
    from agentflow.app.subjects.subject import resolve, simulate_lines, simulate_one
    from agentflow.app.tasks import find_task
    from agentflow.cli.display.show_machines import show_rollout
    from agentflow.cli.display.text import show_count
    from agentflow.machine.formats.detect import read_lines

    how: dict[str, Any] = {
        "workers": workers,
        "queries": query or (),
        "rate": rate,
        "power": power == "on",
        "interval": interval,
    }
    if lines:
        if task is None:
            raise UsageError("--jsonl reads machines only; name their task with --task")
        level = find_task(task, knobs or (), engine)
        if save:
            raise UsageError("--save needs a single machine; remove --jsonl")
        found = read_lines(machine)
        _print_all(simulate_lines(found, level, seed=seed, open_pool=pools_on(backend), **how))
        return
    if backend != "local":
        raise UsageError(
            f"--backend {backend} is for many machines: add --jsonl, or remove --backend"
        )
    subject = resolve(machine, task, knobs, seed, engine)
    result = simulate_one(subject, say=show_count("trial"), save=save, **how)
    print_result(result, as_json, show_rollout)


def _print_all(results: AsyncIterator[Any]) -> None:
    import asyncio

    async def print_each() -> None:
        async for result in results:
            print_json(result)

    asyncio.run(print_each())


@commands.command(epilog="Example: agentflow render car.json --task movement --out car.mp4")
def render(
    source: str,
    task: options.Task = None,
    knobs: options.Knobs = None,
    engine: options.Engine = None,
    seed: options.Seed = 0,
    out: Path | None = None,
    view: str = "three-quarter",
    size: str | None = None,
    style: str = "screen",
    fps: int | None = None,
    moments: int | None = None,
    scene: bool = False,
    axes: bool = False,
    scale: bool = False,
    transparent: bool = False,
) -> None:
    """Draw a machine (.png), film its simulation (.gif, .mp4) or export it in 3D (.glb).

    Films have the course, distance marks, and a dotted line for the path of the boulder or of the
    root block; 0 m is where a score that is a distance is 0. Blocks that broke off are red. From
    the moment at which the score is earned, a card tells it, and a flag marks a distance. An
    invalid machine can only be drawn; the blocks that overlap are red.

    Args:
        source: Run directory or machine file.
        out: Output file: .png, .gif, .mp4 or .glb. Without an extension, both a .png and a .gif are
            written.
        view: Viewpoint: front, back, left, right, top, three-quarter or sheet (all six).
        size: Width and height of the whole picture in pixels, such as 1920x1080.
        style: Ground: screen or paper (white).
        fps: Frames per second of a film, up to 60.
        moments: Draw so many moments of the simulation at one scale, until the score is earned.
        scene: Draw the level, with the machine where it starts.
        axes: Draw the axes x+, y+ and z+, which a sheet always has.
        scale: Draw a scale bar, and no view with perspective.
        transparent: Draw nothing behind the machine.
    """
    from agentflow.app.design.plan import level_note
    from agentflow.app.pages.pictures import Wanted, read_size, render_file, render_run
    from agentflow.app.tasks import find_task
    from agentflow.cli.display.live import print_remark
    from agentflow.cli.display.text import show_count
    from agentflow.runs import read_document, state_of

    wanted = Wanted(view, read_size(size), style, fps, moments, scene, axes, scale, transparent)
    if Path(source).is_dir():
        state_of(Path(source))  # raises for a directory that is not a run
        if task is not None or knobs or seed:
            raise UsageError("a run has its own task and seed; remove --task, --set and --seed")
        files = render_run(Path(source), out, wanted, show_count, engine)
        if note := level_note(Path(source), read_document(Path(source))):
            print_remark(note)
    else:
        level = find_task(task or "movement", knobs or (), engine)
        path = out or Path("machine")
        files = render_file(source, level, seed, path, wanted, show_count, print_remark)
    for file in files.values():
        print(file)


@commands.command(epilog="Example: agentflow blocks 63")
def blocks(
    name: Annotated[str | None, typer.Argument()] = None,
    picture: Path | None = None,
    as_json: options.Json = False,
) -> None:
    """List all blocks, or show one block and its faces.

    Args:
        name: A block's type id or name.
        picture: Draw the block with numbered faces and axes to this .png file; without a block,
            draw all blocks to this directory.
    """
    from agentflow.app.machines.files import find_block, list_blocks
    from agentflow.cli.display.show_machines import show_block, show_blocks

    if picture is not None:
        from agentflow.app.pages.blocks import draw_all, draw_named

        for path in draw_all(picture) if name is None else [draw_named(name, picture)]:
            print(path)
    elif name is None:
        print_result(list_blocks(), as_json, show_blocks)
    else:
        print_result(find_block(name), as_json, show_block)
