"""The command evaluate. Importing this module registers it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from agentflow.cli import options
from agentflow.cli.display.text import show_count
from agentflow.cli.root import commands, print_result
from agentflow.errors import UsageError

SAMPLING = ("model.sampling.temperature=1.0", "model.sampling.top_p=1.0")
"""How replies are sampled unless `--set` or an option says otherwise: every token by its share."""


@commands.command(epilog="Example: agentflow evaluate procedural --task throwing --out evaluation")
def evaluate(
    model: str,
    out: Annotated[Path, typer.Option()],
    task: options.Task = None,
    tasks: str | None = None,
    samples: Annotated[int, typer.Option(min=1)] = 50,
    base_url: options.BaseUrl = None,
    seed: options.RunSeed = None,
    temperature: float | None = None,
    top_p: float | None = None,
    name: Annotated[str, typer.Option(show_default="name of the directory")] = "",
    settings: options.Settings = None,
    engine: options.Engine = None,
    workers: Annotated[int | None, typer.Option(min=1)] = None,
    backend: options.Backend = "local",
    as_json: options.Json = False,
) -> None:
    """Evaluate a model: sample whole machines, simulate them, count how many are valid and good.

    Each sample is one reply to the prompt of a designer, without retries. The numbers are those of
    all replies, with a score of 0 for each without a valid machine. Replies whose simulation
    crashed or timed out are counted and left out.

    Args:
        model: Model name at the endpoint, a folder with a model or a training run, or procedural.
        out: Directory of the evaluation; resumed if it exists.
        tasks: Several tasks, separated by commas, as in throwing,movement.
        samples: Replies to each task.
        temperature: Sampling temperature (default: 1).
        top_p: Sample only from the most likely tokens with this total probability (default: 1).
        name: Name of the row in tables, such as Cold-start; evaluations with the same name are
            pooled.
        workers: Worker processes for simulation (default: 2).
    """
    from agentflow.app.design.config import load_config
    from agentflow.app.pools import pools_on
    from agentflow.cli.display.live import print_remark
    from agentflow.cli.display.show_learning import show_evaluation
    from agentflow.training.evaluation.evaluate import evaluate as carry_out

    if (task is None) == (tasks is None):
        raise UsageError("name one task with --task, or several with --tasks")
    keys = {
        "model.name": model,
        "model.base_url": base_url,
        "model.sampling.temperature": temperature,
        "model.sampling.top_p": top_p,
        "seed": seed,
        "engine": engine,
        "workers": workers,
    }
    found = carry_out(
        load_config(None, (*SAMPLING, *(settings or ())), keys),
        [part.strip() for part in (tasks or task or "").split(",")],
        samples,
        out,
        name=name,
        notify=print_remark,
        say=show_count("sample"),
        open_pool=pools_on(backend),
    )
    print_result(found.model_dump(mode="json"), as_json, show_evaluation)
