"""The command studio. Importing this module registers it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from agentflow.cli.root import commands
from agentflow.errors import UsageError
from agentflow.extras import needs_extra


@commands.command(epilog="Example: agentflow studio --runs runs")
def studio(
    runs: Path = Path("runs"),
    port: Annotated[int | None, typer.Option(min=0, max=65535)] = None,
) -> None:
    """Open a local page to watch runs, start them, and build machines by hand.

    The printed address opens it in one browser, once. Nothing leaves this computer unless you name
    a model endpoint. Only the directory of runs is read and written.

    Args:
        runs: Directory of the runs to show and to add to.
        port: Port on 127.0.0.1; 0 is any free one. Without one, it is the same each time for a
            directory of runs, if it is free.
    """
    if runs.exists() and not runs.is_dir():
        raise UsageError(f"{runs} is not a directory; name the directory of your runs with --runs")
    with needs_extra("studio"):
        from agentflow.studio.app import serve
    serve(runs, port, lambda address: print(address, flush=True))
