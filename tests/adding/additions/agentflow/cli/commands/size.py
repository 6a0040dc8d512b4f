"""The command that tells the size of a run's best machine. Importing this module registers it."""

from __future__ import annotations

from agentflow.cli.options import Json, Run
from agentflow.cli.root import commands, print_result


@commands.command(epilog="Example: agentflow size runs/recorded-throwing")
def size(run: Run, as_json: Json = False) -> None:
    """Tell the number of blocks of a run's best machine."""
    from agentflow.app.inspect.sizes import size_of

    from agentflow.cli.display.show_runs import show_size

    print_result(size_of(run), as_json, show_size)
