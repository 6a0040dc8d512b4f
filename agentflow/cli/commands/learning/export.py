"""Commands that write tasks for other programs. Importing this module registers them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from agentflow.cli import options
from agentflow.cli.root import print_result, subcommands
from agentflow.errors import UsageError

export = subcommands(
    "export",
    help="Write tasks in the formats of other programs.",
    epilog="Example: agentflow export harbor --tasks throwing,bridge/2 --out harbor",
)


@export.command(epilog="Example: agentflow export harbor --tasks throwing,bridge/2 --out harbor")
def harbor(
    out: Annotated[Path, typer.Option()],
    tasks: str | None = None,
    benchmark: Annotated[Path | None, typer.Option("--set")] = None,
    with_solutions: bool = False,
    wheel: Path | None = None,
    engine: options.Engine = None,
    as_json: options.Json = False,
) -> None:
    """Write tasks for Harbor: an agent works in a container, and a script grades its machine.

    Args:
        out: Directory; each task is a folder in it.
        tasks: Tasks, such as throwing,movement/3.
        benchmark: Benchmark whose items to write, such as benchmark or fresh/set.yaml.
        with_solutions: Write the best known machines as solutions.
        wheel: Wheel of agentflow, from scripts/release, which containers install; default: this
            version from the package index.
    """
    names = [name.strip() for name in (tasks or "").split(",") if name.strip()]
    if bool(names) == (benchmark is not None):
        raise UsageError("name tasks with --tasks, or a benchmark with --set")
    from agentflow.integrations.harbor import export as write
    from agentflow.integrations.harbor import items_of, items_of_set

    items = items_of(names) if benchmark is None else items_of_set(benchmark)
    folders = write(items, out, solutions=with_solutions, engine=engine, wheel=wheel)
    print_result({"folders": folders}, as_json, lambda found: print(*found["folders"], sep="\n"))
