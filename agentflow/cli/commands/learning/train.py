"""Commands that train models. Importing this module registers them."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from agentflow.cli import options
from agentflow.cli.root import print_result, subcommands

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
    list[str] | None,
    typer.Option("--set", help="Set a configuration key, key=value; repeatable."),
]
Resume = Annotated[
    bool,
    typer.Option(
        "--resume",
        help="Continue the interrupted training run in --out, if there is one.",
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
