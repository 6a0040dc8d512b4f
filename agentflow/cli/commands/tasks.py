"""The command that lists and draws tasks. Importing this module registers it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from agentflow.cli import options
from agentflow.cli.root import commands, print_result
from agentflow.errors import UsageError


@commands.command(epilog="Example: agentflow tasks throwing/4 --picture throwing-4.png")
def tasks(
    name: Annotated[
        str | None, typer.Argument(help="Level to show: its name, or the path of a YAML file.")
    ] = None,
    knobs: options.Knobs = None,
    picture: Annotated[
        Path | None,
        typer.Option(help="Save a drawing of the level (top and right views) to this .png file."),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(help="Directory in which to save drawings of the level, or of all levels."),
    ] = None,
    html: Annotated[
        Path | None,
        typer.Option(help="Write an HTML page with drawings of the level, or of all levels."),
    ] = None,
    as_json: options.Json = False,
) -> None:
    """List all levels, or show one level: scene, schedule, score, blocks and knobs."""
    from agentflow.app.tasks import list_tasks, task_json
    from agentflow.cli.display.show_tasks import show_task, show_tasks

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
