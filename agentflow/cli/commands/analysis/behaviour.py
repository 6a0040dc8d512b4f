"""The command behaviour. Importing this module registers it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from agentflow.cli.root import Format, Json, commands, needs_extra, print_json, print_table


@commands.command(epilog="Example: agentflow behaviour runs/language-model-jumping")
def behaviour(
    sources: Annotated[
        list[Path],
        typer.Argument(metavar="SOURCE...", help="Run, or directory that contains runs."),
    ],
    form: Format = "text",
    as_json: Json = False,
) -> None:
    """Show how the designers of runs behave: predictions, repairs, edits, effort.

    One row per source: edits that failed although success was predicted, repairs that keep the
    mechanism of a failed machine, how large edits are, errors of predicted scores, and each role's
    share of the tokens. The rules are in docs/behaviour.md.
    """
    from agentflow.app.inspect.behaviour import format_results, observe

    with needs_extra("diversity"):
        results = observe(sources)
    if as_json:
        print_json({"sources": [result.to_json() for result in results]})
        return
    print_table(format_results(results, form), form)
