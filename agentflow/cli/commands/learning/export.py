"""Commands that write tasks for other programs. Importing this module registers them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from agentflow.cli import options
from agentflow.cli.root import print_result, subcommands

export = subcommands(
    "export",
    help="Write tasks in the formats of other programs.",
    epilog="Example: agentflow export harbor --tasks throwing,bridge/2 --out harbor",
)


@export.command(epilog="Example: agentflow export harbor --tasks throwing,bridge/2 --out harbor")
def harbor(
    out: Annotated[Path, typer.Option(help="Directory; each task is a folder in it.")],
    tasks: Annotated[str, typer.Option(help="Tasks, such as throwing,movement/3.")],
    with_solutions: Annotated[
        bool,
        typer.Option("--with-solutions", help="Write the best known machines as solutions."),
    ] = False,
    wheel: Annotated[
        Path | None,
        typer.Option(
            help="Wheel of agentflow, from scripts/release, which containers install; default: "
            "this version from the package index."
        ),
    ] = None,
    engine: options.Engine = None,
    as_json: options.Json = False,
) -> None:
    """Write tasks for Harbor: an agent works in a container, and a script grades its machine."""
    from agentflow.integrations.harbor import export as write

    names = [name.strip() for name in tasks.split(",") if name.strip()]
    folders = write(names, out, solutions=with_solutions, engine=engine or "auto", wheel=wheel)
    print_result({"folders": folders}, as_json, lambda found: print(*found["folders"], sep="\n"))
