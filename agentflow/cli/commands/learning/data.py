"""Commands for data to learn from. Importing this module registers them."""

from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from agentflow.cli import options
from agentflow.cli.root import print_result, subcommands
from agentflow.progress import Progress, silent

data = subcommands(
    "data",
    help="Make data to learn from: pairs of a prompt and a machine that works.",
    epilog="Example: agentflow data generate configs/objectives.yaml --samples 20 --out answers",
)

Set = Annotated[Path, typer.Option("--out", help="Directory of the set; created if missing.")]
Evaluation = Annotated[
    list[Path] | None,
    typer.Option(
        help="Run or evaluation of a model, or directory with some: leave its machines out; "
        "repeatable."
    ),
]
Licence = Annotated[
    str | None, typer.Option(help="Licence of the set, for its card.", show_default="by model")
]
Workers = Annotated[int, typer.Option(min=1, max=256, help=options.WORKERS)]


@data.command(
    epilog="Example: agentflow data generate configs/objectives.yaml --samples 20 --variants 1 "
    "--out answers"
)
def generate(
    objectives: Path,
    out: Annotated[Path, typer.Option()],
    samples: Annotated[int, typer.Option(min=1)] = 250,
    limit: Annotated[int | None, typer.Option(min=1)] = None,
    variants: Annotated[float, typer.Option(min=0, max=100)] = 0.0,
    model: options.ModelName = None,
    base_url: options.BaseUrl = None,
    settings: options.Settings = None,
    seed: int | None = None,
    workers: Annotated[int, typer.Option(min=1, max=1024)] = 8,
    quiet: options.Quiet = False,
    as_json: options.Json = False,
) -> None:
    """Ask a model for machines for design objectives, and record its answers.

    Run the same command again to continue: recorded answers are never requested again.

    Args:
        objectives: YAML file with design objectives.
        out: Directory of the answers; created if missing.
        samples: Answers to each objective.
        limit: Maximum number of answers, spread over the objectives.
        variants: Average number of variants to make of each valid answer, each by 1 or 2 random
            legal edits. Filtering keeps those that also work.
        seed: Random seed of the first samples.
        workers: Requests to the model at a time.
    """
    from agentflow.app.design.config import load_config
    from agentflow.cli.display.live import print_remark
    from agentflow.cli.display.show_learning import show_answers
    from agentflow.training.data.generate import generate as record
    from agentflow.training.data.generate import plan_answers
    from agentflow.training.objectives.objective import read_objectives

    keys = {"model.name": model, "model.base_url": base_url, "seed": seed}
    config = load_config(None, settings or (), keys)
    plan = plan_answers(
        read_objectives(objectives), config, samples=samples, limit=limit, variants=variants
    )
    found = record(
        plan, config, out, workers, partial(print_remark, quiet=quiet), _progress("answer", quiet)
    )
    print_result(found, as_json, show_answers)


@data.command(
    epilog="Example: agentflow data filter answers --out set --evaluation runs/recorded-throwing"
)
def filter(
    answers: Path,
    out: Set,
    evaluation: Evaluation = None,
    engine: options.Engine = None,
    licence: Licence = None,
    workers: Workers = 2,
    backend: options.Backend = "local",
    quiet: options.Quiet = False,
    as_json: options.Json = False,
) -> None:
    """Keep the answers whose machines work, are new, and are not in the evaluation.

    Writes train.jsonl, dev.jsonl and a card (README.md, card.json). Run the same command again to
    continue.

    Args:
        answers: Directory made by agentflow data generate.
    """
    from agentflow.app.pools import pools_on
    from agentflow.training.data.filter import filter_answers

    card = filter_answers(
        answers,
        out,
        evaluation=evaluation or (),
        engine=engine or "auto",
        licence=licence,
        workers=workers,
        show=_progress("machine", quiet),
        open_pool=pools_on(backend),
    )
    _print_card(card, out, as_json)


@data.command("import", epilog="Example: agentflow data import machines.jsonl --out set")
def import_(
    source: Path,
    out: Set,
    evaluation: Evaluation = None,
    licence: Licence = None,
    as_json: options.Json = False,
) -> None:
    """Make a set from public conversations, or from Besiege machines with captions.

    The machines are checked, but not simulated.

    Args:
        source: JSON or JSONL file of conversations (messages of system, user and assistant, with a
            machine in the last), or directory with Besiege machines (.bsg), each with a caption in
            a .txt file of the same name.
    """
    from agentflow.training.data.exchange import import_set

    card = import_set(source, out, evaluation=evaluation or (), licence=licence)
    _print_card(card, out, as_json)


@data.command(
    epilog="Example: agentflow data prompts --tasks throwing,movement --count 512 --out "
    "prompts.parquet"
)
def prompts(
    out: Annotated[Path, typer.Option()],
    tasks: str = "throwing,movement",
    count: Annotated[int, typer.Option(min=1)] = 512,
    engine: options.Engine = None,
    as_json: options.Json = False,
) -> None:
    """Write prompts for reinforcement learning, in the columns that verl and TRL read.

    Each row is the prompt of a designer; each row has its own seed.

    Args:
        out: Parquet file to write.
        tasks: Tasks, such as throwing,movement/3.
        count: Rows, alternating between tasks.
    """
    from agentflow.training.data.exchange import write_prompts

    names = [name.strip() for name in tasks.split(",") if name.strip()]
    written = write_prompts(out, names, count, engine or "auto")
    print_result(written, as_json, lambda found: print(f"{found['rows']} prompts: {found['out']}"))


def _progress(noun: str, quiet: bool) -> Progress:
    from agentflow.cli.display.text import show_count

    return silent if quiet else show_count(noun)


def _print_card(card: Any, out: Path, as_json: bool) -> None:
    from agentflow.cli.display.show_learning import show_card

    print_result({"out": str(out), **card.model_dump(mode="json")}, as_json, show_card)
