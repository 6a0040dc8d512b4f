"""Commands for tasks and prompt sets, and to begin packages. Importing this registers them."""

from pathlib import Path
from shlex import quote
from typing import Annotated, Literal

import typer

from agentflow.agents.registry import ROLES
from agentflow.cli import options
from agentflow.cli.display.text import escape_controls
from agentflow.cli.root import commands, print_json, print_result, subcommands
from agentflow.errors import UsageError
from agentflow.prompts.registry import PROMPT_SETS


@commands.command(epilog="Example: agentflow tasks throwing/4 --picture throwing-4.png")
def tasks(
    name: Annotated[str | None, typer.Argument()] = None,
    knobs: options.Knobs = None,
    picture: Path | None = None,
    out: Path | None = None,
    html: Path | None = None,
    as_json: options.Json = False,
) -> None:
    """List all levels, or show one level: scene, schedule, score, blocks and knobs.

    Args:
        name: Level to show: its name, or the path of a YAML file.
        picture: Save a drawing of the level (top and right views) to this .png file.
        out: Directory in which to save drawings of the level, or of all levels.
        html: Write an HTML page with drawings of the level, or of all levels.
    """
    from agentflow.app.tasks import list_tasks, task_json
    from agentflow.cli.display.show_machines import show_task, show_tasks

    if name is None and (knobs or picture):
        raise UsageError("--set and --picture need one level; name it")
    if html and knobs:
        raise UsageError("--html shows levels with their default knobs; remove --set")
    if picture or out or html:
        _draw(name, knobs or [], picture, out, html)
    elif name is None:
        print_result(list_tasks(), as_json, show_tasks)
    else:
        print_result(task_json(name, knobs or ()), as_json, show_task)


@commands.command(epilog="Example: agentflow new-plugin mine --kind strategy")
def new_plugin(
    folder: Annotated[Path, typer.Argument(metavar="DIR")],
    kind: Annotated[Literal["family", "strategy", "role", "metric", "prompts"], typer.Option()],
    as_json: options.Json = False,
) -> None:
    """Write a new package with one part of your own and its test, ready to install.

    Args:
        folder: New directory; its name is that of the part.
        kind: Kind of part: a family of tasks, a search strategy, a role and a workflow that asks
            it, a metric, or a prompt set.
    """
    from agentflow.app.plugins.scaffold import new_plugin as write

    made = write(folder, kind)
    if as_json:
        print_json({"path": str(made.path), "files": list(made.files), "use": made.use})
        return
    where = quote(str(made.path))
    for line in (
        *(f"{made.path / name}" for name in made.files),
        f"install it: pip install --no-deps --editable {where}",
        f"test it: pytest {where}",
        f"use it: {made.use}",
    ):
        print(escape_controls(line))


def _draw(
    name: str | None, knobs: list[str], picture: Path | None, out: Path | None, html: Path | None
) -> None:
    from agentflow.app.pages import tasks as taskpages
    from agentflow.app.tasks import list_tasks

    if name is not None and picture:
        print(taskpages.draw_task(name, knobs, picture))
    if name is not None and out:
        print(taskpages.draw_task(name, knobs, out / taskpages.picture_name(name)))
    if name is None and out:
        for path in taskpages.draw_all(out):
            print(path)
    if html:
        names = [item["name"] for item in list_tasks()] if name is None else [name]
        print(taskpages.write_page(names, html))


prompts = subcommands(
    "prompts",
    help="Inspect the prompts that models get.",
    epilog="Example: agentflow prompts show --role designer --task throwing",
)

Set = Annotated[str, typer.Argument(help="Prompt set.")]


@prompts.command("list", epilog="Example: agentflow prompts list")
def list_(as_json: options.Json = False) -> None:
    """List the prompt sets and their content hashes."""
    from agentflow.app.prompts import list_prompt_sets

    lines = "{name:<12} {digest}  {about}".format_map
    print_result(list_prompt_sets(), as_json, lambda found: print(*map(lines, found), sep="\n"))


@prompts.command(epilog="Example: agentflow prompts show --role refiner --task throwing")
def show(
    role: Annotated[str, typer.Option(help=f"Role: {', '.join(ROLES.ours)}.")] = "designer",
    task: options.NamedTask = "throwing",
    name: Annotated[
        str,
        typer.Option("--prompt-set", help=f"Prompt set to show: {', '.join(PROMPT_SETS.ours)}."),
    ] = "default",
    knobs: Annotated[list[str] | None, typer.Option("--knob", help=options.SET_KNOB)] = None,
    machine: str | None = None,
    as_json: options.Json = False,
) -> None:
    """Print a prompt exactly as a model gets it, with an estimate of its token count.

    Args:
        machine: Machine to include in the prompt; default: a small example.
    """
    from agentflow.app.machines.files import machine_text
    from agentflow.app.prompts import render_prompt
    from agentflow.app.tasks import find_task

    text = None if machine is None else machine_text(machine)
    found = render_prompt(name, role, find_task(task, knobs or ()).brief, text)
    if as_json:
        print_json(found)
        return
    print(f"--- system\n{found['system']}\n--- user\n{found['user']}")
    print(
        f"--- about {found['tokens']} tokens; prompt set {found['set']}, content hash "
        f"{found['digest']}"
    )


@prompts.command(epilog="Example: agentflow prompts diff default compact")
def diff(first: Set, second: Set) -> None:
    """Compare the templates of two prompt sets."""
    from agentflow.app.prompts import compare_prompt_sets

    print(compare_prompt_sets(first, second) or "identical")
