"""What the trainers of supervised fine-tuning and of reinforcement learning share."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

import torch
from transformers import PrinterCallback, TrainerCallback

from agentflow.errors import ConfigError
from agentflow.models.local.folder import ModelFolder
from agentflow.runs import Notify
from agentflow.training.config import TrainingConfig
from agentflow.training.model import save_model
from agentflow.training.record import TrainingRun

OPTIMISERS = {"adamw": "adamw_torch", "adamw_8bit": "adamw_bnb_8bit"}
"""Our name of an optimiser -> the library's."""
SHOWN = 6
"""Most numbers of a step that the user sees."""


def require_one_device(config: TrainingConfig) -> None:
    """Refuse several processes, which would write into one folder, and several GPUs.

    Raises:
        ConfigError: A launcher has started several, or several GPUs are visible.
    """
    other = "recipes/README.md says how to train on several GPUs"
    if (processes := int(os.environ.get("WORLD_SIZE", "1"))) > 1:
        raise ConfigError(
            f"agentflow train is one process, but a launcher started {processes} (WORLD_SIZE): "
            f"start it without accelerate launch or torchrun; {other}"
        )
    if config.device != "cpu" and (visible := torch.cuda.device_count()) > 1:
        raise ConfigError(
            f"agentflow train uses one GPU, but {visible} are visible: choose one, as in "
            f"CUDA_VISIBLE_DEVICES=0; {other}"
        )


def library_options(config: TrainingConfig, run: TrainingRun) -> dict[str, Any]:
    """The arguments that the configurations of TRL's trainers have in common."""
    optimiser = config.optimiser
    on_processor = config.device == "cpu" or not torch.cuda.is_available()
    return {
        "output_dir": str(run.path),
        "max_steps": config.steps,
        "seed": config.seed,
        "use_cpu": on_processor,
        "bf16": config.precision == "bfloat16",
        "optim": OPTIMISERS[optimiser.name],
        "learning_rate": optimiser.learning_rate,
        "lr_scheduler_type": optimiser.schedule,
        "warmup_steps": round(optimiser.warmup * config.steps),
        "weight_decay": optimiser.weight_decay,
        "adam_beta2": optimiser.beta2,
        "max_grad_norm": optimiser.gradient_norm,
        "gradient_checkpointing": config.model.tiny is None and not on_processor,
        "logging_steps": config.log_every,
        "logging_first_step": True,
        "save_strategy": "steps",
        "save_steps": config.save_every,
        "save_total_limit": 2,
        "report_to": "none",
        "disable_tqdm": True,
    }


def seed_torch(config: TrainingConfig) -> None:
    """Set the processor threads and the random seed, before a model is made."""
    if config.threads is not None:
        torch.set_num_threads(config.threads)
    torch.manual_seed(config.seed)


def train(trainer: Any, folder: ModelFolder, run: TrainingRun) -> dict[str, Any]:
    """Train from the last checkpoint on and save the model.

    Returns:
        What the result of every kind of training holds.
    """
    trainer.remove_callback(PrinterCallback)
    trainer.train(resume_from_checkpoint=run.checkpoint and str(run.checkpoint))
    save_model(trainer.model, trainer.processing_class, folder, run.model)
    return {"model": str(run.model), "label": folder.label, "steps": trainer.args.max_steps}


class TrainingNotes(TrainerCallback):
    """Writes what the trainer logs into the curves of a run, and reports them to the user."""

    def __init__(self, run: TrainingRun, names: Mapping[str, str], notify: Notify) -> None:
        """`names`: the trainer's name of a number -> its name in the curves."""
        self._run, self._names, self._notify = run, names, notify

    def on_log(self, _args: Any, state: Any, _control: Any, **given: Any) -> None:
        """Write one line."""
        logs = given["logs"]
        named = {ours: logs.get(name) for name, ours in self._names.items()}
        numbers = {name: value for name, value in named.items() if value is not None}
        if numbers and state.is_world_process_zero:
            self._run.note(state.global_step, numbers)
            shown = ", ".join(f"{name} {numbers[name]:.3g}" for name in list(numbers)[:SHOWN])
            self._notify(f"step {state.global_step} of {state.max_steps}: {shown}")
