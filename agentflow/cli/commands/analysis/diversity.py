"""The command diversity. Importing this module registers it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from agentflow.cli.display.text import show_count
from agentflow.cli.root import (
    Format,
    Json,
    Published,
    commands,
    needs_extra,
    print_json,
    print_table,
)


@commands.command(epilog="Example: agentflow diversity runs/recorded-throwing --published")
def diversity(
    sources: Annotated[
        list[Path],
        typer.Argument(
            metavar="SOURCE...",
            help="Run, sweep, training run (one row per step), or folder of .json or .bsg files.",
        ),
    ],
    valid: Annotated[bool, typer.Option("--valid", help="Leave out invalid machines.")] = False,
    most: Annotated[
        int,
        typer.Option(
            "--n", min=2, help="Machines of each source; if it has more, a random sample is used."
        ),
    ] = 20,
    seed: Annotated[
        int, typer.Option(min=0, help="Random seed of samples, embedding and intervals.")
    ] = 0,
    form: Format = "text",
    published: Published = False,
    as_json: Json = False,
) -> None:
    """Measure how different the machines of a source are from each other.

    Two measures compare surfaces (Chamfer and Hausdorff distance), one volumes (IoU), and two the
    trees of blocks (graph similarity, tree edit distance). Each is a mean over all pairs.
    """
    from agentflow.app.diversity.results import format_results, measure_sources, published_json

    # the extra leaves gensim out on Python 3.14, where it must be compiled
    with needs_extra("diversity", "gensim"):
        results = measure_sources(sources, valid, most, seed, show_count("pair"))
    if as_json:
        known = {"published": published_json()} if published else {}
        print_json({"sources": [result.to_json() for result in results], **known})
        return
    print_table(format_results(results, form, published=published), form)
