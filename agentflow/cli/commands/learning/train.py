"""Commands that train and evaluate models, and write tasks for other programs. Importing registers
them."""

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from agentflow.cli import options
from agentflow.cli.display.text import show_count
from agentflow.cli.root import commands, print_result, subcommands
from agentflow.errors import UsageError

train = subcommands(
    "train",
    help="Train models to design machines.",
    epilog="Example: agentflow train sft --config configs/train/sft_tiny.yaml --data SET --out DIR",
)

TrainingFile = Annotated[
    Path, typer.Option(help="YAML configuration file, such as one of configs/train.")
]
TrainingFolder = Annotated[
    Path, typer.Option(help="Training directory: curves, checkpoints, the model.")
]
TrainingSettings = Annotated[
    list[str] | None, typer.Option("--set", help="Set a configuration key, key=value; repeatable.")
]
Resume = Annotated[
    bool,
    typer.Option(
        "--resume", help="Continue the interrupted training run in --out, if there is one."
    ),
]


@train.command(
    epilog="Example: agentflow train sft --config configs/train/sft_tiny.yaml --data SET --out DIR"
)
def sft(
    config: TrainingFile,
    out: TrainingFolder,
    data: str | None = None,
    settings: TrainingSettings = None,
    resume: Resume = False,
    quiet: options.Quiet = False,
    as_json: options.Json = False,
) -> None:
    """Train a model on pairs of prompt and reply (supervised fine-tuning).

    The model is then in the folder `model` of the training directory.

    Args:
        data: Data set: a folder with train.jsonl and dev.jsonl (key data).
    """
    from agentflow.cli.display.live import print_remark
    from agentflow.cli.display.show_learning import show_training
    from agentflow.models.local.libraries import require_libraries
    from agentflow.training.config import SftConfig, read_config

    built = read_config(SftConfig, config, settings or (), {"data": data})
    require_libraries(*built.libraries)
    from agentflow.training.trainer import train_sft

    print_result(
        train_sft(built, out, resume, partial(print_remark, quiet=quiet)), as_json, show_training
    )


@train.command(
    epilog="Example: agentflow train grpo --config configs/train/grpo_tiny.yaml --model MODEL "
    "--out DIR --set advantage.name=pkpo --set advantage.scale=false"
)
def grpo(
    config: TrainingFile,
    out: TrainingFolder,
    model: str | None = None,
    tools: bool = False,
    settings: TrainingSettings = None,
    resume: Resume = False,
    backend: options.Backend = "local",
    quiet: options.Quiet = False,
    as_json: options.Json = False,
) -> None:
    """Train a model by the simulated scores of its machines (reinforcement learning).

    The model writes groups of replies to the prompts of tasks. Simulations turn each group into
    rewards, and how much better or worse a reply is than its group changes the model (GRPO). The
    model is then in the folder `model` of the training directory.

    Args:
        model: Model to start from: a folder, such as one that train sft writes, or a name on a hub
            (key model.name).
        tools: Let the model call the tools of a bench over several turns, and reward what it
            submits (key tools).
    """
    from agentflow.app.pools import pools_on
    from agentflow.cli.display.live import print_remark
    from agentflow.cli.display.show_learning import show_training
    from agentflow.models.local.libraries import require_libraries
    from agentflow.training.config import read_config
    from agentflow.training.grpo.config import GrpoConfig

    keys = {"model.name": model, "tools": tools or None}
    built = read_config(GrpoConfig, config, settings or (), keys)
    require_libraries(*built.libraries)
    from agentflow.integrations.trl import bench_environment
    from agentflow.training.grpo.train import train_grpo

    notify, pools = partial(print_remark, quiet=quiet), pools_on(backend)
    environment = partial(bench_environment, scored=False)
    trained = train_grpo(built, out, resume, notify, pools, environment)
    print_result(trained, as_json, show_training)


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
