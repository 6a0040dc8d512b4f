"""The command that compares physics engines. Importing this module registers it."""

from __future__ import annotations

from typing import Annotated

import typer

from agentflow.cli import options
from agentflow.cli.root import commands, print_result


@commands.command(epilog="Example: agentflow engines --machines 200")
def engines(
    machines: Annotated[int, typer.Option(min=0)] = 20,
    workers: options.Workers = 2,
    as_json: options.Json = False,
) -> None:
    """Compare the installed physics engines.

    The best known machine of every level is simulated on each engine: score, first connection to
    break, difference. Then machines of the procedural model are ranked by their scores on each
    engine. The rank correlation (Spearman's) is 1 if both rank them alike, and 0 if one ranking
    says nothing about the other.

    Args:
        machines: Machines of the procedural model per family, to rank.
    """
    from agentflow.app.subjects.engines import compare_engines
    from agentflow.cli.display.show_scores import show_engines
    from agentflow.cli.display.text import show_count

    found = compare_engines(machines, workers, show_count("simulation"))
    print_result(found, as_json, show_engines)
