"""Commands that measure models by what they do: behaviour, diagnose, diversity.

Importing this module registers them.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated, Literal

import typer

from agentflow.cli import options
from agentflow.cli.display.text import show_count
from agentflow.cli.root import commands, print_json, print_sources, print_table
from agentflow.errors import UsageError
from agentflow.extras import needs_extra

OVERLAP = "overlap"
PAIRS = 77
"""The published accuracies are multiples of 1/77."""
QUESTIONS = 24


@commands.command(epilog="Example: agentflow behaviour runs/language-model-throwing")
def behaviour(
    sources: Annotated[list[Path], typer.Argument(metavar="SOURCE...")],
    form: options.Format = "text",
    as_json: options.Json = False,
) -> None:
    """Show how the designers of runs behave: predictions, repairs, edits, effort.

    One row per source: edits that failed although success was predicted, repairs that keep the
    moving types of a failed machine, how large edits are, errors of predicted scores, and each
    role's share of the tokens. The rules are in docs/reference/behaviour.md.

    Args:
        sources: Run, or directory that contains runs.
    """
    from agentflow.app.inspect.behaviour import format_results, observe

    with needs_extra("diversity"):
        results = observe(sources)
    print_sources(results, form, as_json, format_results)


@commands.command(epilog="Example: agentflow diagnose overlap --model NAME --out overlap")
def diagnose(
    name: Annotated[Literal["overlap", "facing", "outcome"], typer.Argument(metavar="DIAGNOSTIC")],
    out: Annotated[Path, typer.Option()],
    model: options.ModelName = None,
    base_url: options.BaseUrl = None,
    pairs: Annotated[int | None, typer.Option(min=1, show_default=str(PAIRS))] = None,
    questions: Annotated[int | None, typer.Option(min=1, show_default=str(QUESTIONS))] = None,
    seed: int = 0,
    form: options.Format = "text",
    published: options.Published = False,
    settings: options.Settings = None,
    engine: options.Engine = None,
    workers: options.Workers = 2,
    as_json: options.Json = False,
) -> None:
    """Ask a model what it knows about machines: their geometry, and how they will behave.

    The machines are random ones and designs of the built-in model. Replies without an answer count
    as wrong.

    Args:
        name: overlap: which blocks overlap. facing: which way blocks face, where their centres are.
            outcome: will the machine stand, drive or throw; judged by simulation.
        out: Directory of the diagnosis; resumed if it exists.
        pairs: Total number of overlapping pairs, for overlap.
        questions: Questions, for facing and outcome.
        seed: Random seed of the questions.
    """
    from agentflow.app.design.config import load_config
    from agentflow.app.diagnose.results import (
        format_results,
        published_accuracies,
        require_published,
    )
    from agentflow.app.diagnose.run import diagnose as carry_out
    from agentflow.cli.display.live import print_remark

    if published:
        require_published(name)
    keys = {
        "model.name": model,
        "model.base_url": base_url,
        "seed": seed,
        "engine": engine,
        "workers": workers,
    }
    found = carry_out(
        name,
        load_config(None, settings or (), keys),
        _size(name, pairs, questions),
        out,
        notify=print_remark,
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


@commands.command(epilog="Example: agentflow diversity runs/recorded-throwing --published")
def diversity(
    sources: Annotated[list[Path], typer.Argument(metavar="SOURCE...")],
    valid: bool = False,
    most: Annotated[int, typer.Option("--n", min=2)] = 20,
    seed: Annotated[int, typer.Option(min=0)] = 0,
    form: options.Format = "text",
    published: options.Published = False,
    as_json: options.Json = False,
) -> None:
    """Measure how different the machines of a source are from each other.

    Two measures compare surfaces (Chamfer and Hausdorff distance), one volumes (IoU), and two the
    trees of blocks (graph similarity, tree edit distance). Each is a mean over all pairs.

    Args:
        sources: Run, sweep, training run (one row per step), or folder of .json or .bsg files.
        valid: Leave out invalid machines.
        most: Machines of each source; if it has more, a random sample is used.
        seed: Random seed of samples, embedding and intervals.
    """
    from agentflow.app.diversity.results import format_results, measure_sources, published_json

    # the extra leaves gensim out on Python 3.14, where it must be compiled
    with needs_extra("diversity", "gensim"):
        results = measure_sources(sources, valid, most, seed, show_count("pair"))
    known = {"published": published_json()} if published else {}
    print_sources(results, form, as_json, partial(format_results, published=published), **known)
