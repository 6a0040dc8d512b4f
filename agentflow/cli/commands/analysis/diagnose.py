"""The command diagnose. Importing this module registers it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from agentflow.cli.display.text import show_count
from agentflow.cli.root import (
    BaseUrl,
    Engine,
    Format,
    Json,
    ModelName,
    Published,
    Settings,
    commands,
    print_json,
    print_table,
)
from agentflow.errors import UsageError

OVERLAP = "overlap"
PAIRS = 77
"""The published accuracies are multiples of 1/77."""
QUESTIONS = 24


@commands.command(epilog="Example: agentflow diagnose overlap --model NAME --out overlap")
def diagnose(
    name: Annotated[
        Literal["overlap", "facing", "fate"],
        typer.Argument(
            metavar="DIAGNOSTIC",
            help="overlap: which blocks overlap. facing: which way blocks face, where their "
            "centres are. fate: will the machine stand, drive or throw; judged by simulation.",
        ),
    ],
    out: Annotated[
        Path, typer.Option(help="Directory of the diagnosis; given again, it is continued.")
    ],
    model: ModelName = None,
    base_url: BaseUrl = None,
    pairs: Annotated[
        int | None,
        typer.Option(min=1, help="Overlapping pairs in all, for overlap.", show_default=str(PAIRS)),
    ] = None,
    questions: Annotated[
        int | None,
        typer.Option(min=1, help="Questions, for facing and fate.", show_default=str(QUESTIONS)),
    ] = None,
    seed: Annotated[int, typer.Option(help="Random seed of the questions.")] = 0,
    form: Format = "text",
    published: Published = False,
    settings: Settings = None,
    engine: Engine = None,
    workers: Annotated[int, typer.Option(min=1, help="Worker processes for simulation.")] = 2,
    as_json: Json = False,
) -> None:
    """Ask a model what it knows of machines: their geometry, and what will become of them.

    The machines are random ones and designs of the built-in model. Replies without an answer count
    as wrong.
    """
    from agentflow.app.design.config import load_config
    from agentflow.app.diagnose.results import (
        format_results,
        published_accuracies,
        require_published,
    )
    from agentflow.app.diagnose.run import diagnose as carry_out
    from agentflow.cli.display.live import print_line

    if published:
        require_published(name)
    options = {
        "model.name": model,
        "model.base_url": base_url,
        "seed": seed,
        "engine": engine,
        "workers": workers,
    }
    found = carry_out(
        name,
        load_config(None, settings or (), options),
        _size(name, pairs, questions),
        out,
        notify=lambda line: print_line(f"agentflow: {line}"),
        say=show_count("question"),
    )
    if as_json:
        about = found.model_dump(mode="json", exclude={"results", "answers"})
        known = {"published": published_accuracies()} if published else {}
        print_json({**about, **(found.results or {}), **known})
        return
    print_table(format_results(found, form, published=published), form)


def _size(name: str, pairs: int | None, questions: int | None) -> int:
    """Pairs of the diagnostic overlap, or questions of the others; the other option is refused."""
    if name == OVERLAP:
        if questions is not None:
            raise UsageError(f"--questions does not apply to {OVERLAP}; use --pairs")
        return pairs or PAIRS
    if pairs is not None:
        raise UsageError(f"--pairs does not apply to {name}; use --questions")
    return questions or QUESTIONS
