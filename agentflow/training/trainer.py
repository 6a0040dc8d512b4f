"""Trainers: what they share, and supervised fine-tuning on a data set, with TRL's trainer."""

import os
from collections.abc import Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import Any

import torch
from datasets import Dataset
from transformers import PrinterCallback, TrainerCallback
from transformers.trainer_pt_utils import get_length_grouped_indices
from trl import SFTConfig as LibraryConfig
from trl import SFTTrainer

from agentflow.errors import ConfigError, UsageError
from agentflow.models.local.folder import ModelFolder
from agentflow.runs import Notify
from agentflow.training.config import SftConfig, TrainingConfig
from agentflow.training.data.pairs import DEV, TRAIN, Pair, read_pairs
from agentflow.training.model import adapter_config, base_folder, load_base, save_model
from agentflow.training.record import About, TrainingRun, digest_base, digest_set

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


CURVES = {
    "loss": "loss",
    "mean_token_accuracy": "token_accuracy",
    "entropy": "entropy",
    "learning_rate": "learning_rate",
    "grad_norm": "gradient_norm",
    "eval_loss": "dev_loss",
    "eval_mean_token_accuracy": "dev_token_accuracy",
    "eval_entropy": "dev_entropy",
}
"""The trainer's name of a number -> its name in the curves. Means over the reply's tokens."""


def train_sft(config: SftConfig, out: Path, resume: bool, notify: Notify) -> Mapping[str, Any]:
    """Train a model on the pairs of a data set.

    Args:
        config: What to do.
        out: The training directory.
        resume: Continue the run in `out`, if there is one.
        notify: Receives remarks for the user.

    Returns:
        The content of result.json.

    Raises:
        UsageError: The data set cannot be read or has no pair that fits; the directory cannot be
            used; or there are several GPUs or processes.
    """
    require_one_device(config)
    pairs = list(read_pairs(Path(config.data) / TRAIN))
    if not pairs:
        raise UsageError(
            f"{config.data} has no pairs to train on; its README.md says which gates dropped them"
        )
    dev = list(islice(read_pairs(Path(config.data) / DEV), config.dev_pairs))
    folder = base_folder(config, {pair.source for pair in pairs})
    inputs = {"data": digest_set(Path(config.data)), **digest_base(config)}
    about = About(kind="sft", label=folder.label, inputs=inputs)
    with TrainingRun.open(out, about, config, resume) as run:
        if run.result is not None:
            return run.result
        if run.checkpoint is not None:
            notify(f"continuing after {run.checkpoint.name}")
        trainer = make_trainer(config, folder, pairs, dev, run, notify)
        left_out = _order_pairs(trainer, config)
        for file, count in ((TRAIN, left_out), (DEV, _leave_out_long(trainer, config))):
            if count:
                long = f"longer than {config.max_tokens} tokens and left out"
                notify(f"{count} pairs of {file} are {long}")
        trained = train(trainer, folder, run)
        model = trainer.model
        return run.finish(
            {
                **trained,
                "pairs": len(pairs) - left_out,
                "left_out": left_out,
                "parameters": sum(p.numel() for p in model.parameters()),
                "trained_parameters": sum(p.numel() for p in model.parameters() if p.requires_grad),
                "dev_loss": _last(trainer.state.log_history, "eval_loss"),
            }
        )


def make_trainer(
    config: SftConfig,
    folder: ModelFolder,
    pairs: Sequence[Pair],
    dev: Sequence[Pair],
    run: TrainingRun,
    notify: Notify,
) -> Any:
    """The library's trainer with its pairs tokenised, in the order of the data set."""
    rows = _rows(folder, pairs)
    seed_torch(config)
    texts = (f"{row['prompt']}{row['completion']}" for row in rows)
    model, tokenizer = load_base(config, texts)
    return SFTTrainer(
        model=model,
        args=_library_config(config, run, measured=bool(dev)),
        train_dataset=Dataset.from_list(rows),
        eval_dataset=Dataset.from_list(_rows(folder, dev)) if dev else None,
        processing_class=tokenizer,
        peft_config=adapter_config(config.peft),
        callbacks=[TrainingNotes(run, CURVES, notify)],
    )


def _library_config(config: SftConfig, run: TrainingRun, measured: bool) -> LibraryConfig:
    """`measured`: whether there are pairs of dev.jsonl; a set of one objective has none."""
    part = config.device_batch or config.batch
    return LibraryConfig(
        **library_options(config, run),
        per_device_train_batch_size=part,
        gradient_accumulation_steps=config.batch // part,
        per_device_eval_batch_size=part,
        eval_strategy="steps" if measured else "no",
        eval_steps=config.dev_every,
        train_sampling_strategy="sequential",
        max_length=None,
    )


def _rows(folder: ModelFolder, pairs: Sequence[Pair]) -> list[dict[str, Any]]:
    """Prompts and completions as the trainer wants them: texts, or messages of a chat."""
    rows = []
    for pair in pairs:
        prompt = folder.prompt([message.model_dump() for message in pair.prompt])
        reply = [{"role": "assistant", "content": pair.reply}]
        completion = pair.reply if isinstance(prompt, str) else reply
        rows.append({"prompt": prompt, "completion": completion})
    return rows


def _order_pairs(trainer: Any, config: SftConfig) -> int:
    """Put the trainer's pairs into the order of all steps; how many are too long and left out.

    Batches hold pairs of similar length, which saves half of the work on padding, and follow each
    other in random order. The order is complete before training begins, so a continued run goes
    on with the right pair.
    """
    lengths, fitting = _fitting(trainer.train_dataset, config)
    if not fitting:
        raise UsageError(
            f"every pair of {config.data} is longer than max_tokens ({config.max_tokens}); the "
            f"shortest has {min(lengths)} tokens"
        )
    wanted, batch = config.steps * config.batch, min(config.batch, len(fitting))
    generator, order = torch.Generator().manual_seed(config.seed), list[int]()
    while len(order) < wanted:
        grouped = get_length_grouped_indices(
            [lengths[i] for i in fitting], batch, generator=generator
        )
        batches = [grouped[i : i + batch] for i in range(0, len(grouped) - batch + 1, batch)]
        shuffled = torch.randperm(len(batches), generator=generator).tolist()
        order += [fitting[i] for number in shuffled for i in batches[number]]
    trainer.train_dataset = trainer.train_dataset.select(order[:wanted])
    return len(lengths) - len(fitting)


def _leave_out_long(trainer: Any, config: SftConfig) -> int:
    """Leave out pairs of dev.jsonl that are too long; how many. If all are, nothing is measured."""
    if trainer.eval_dataset is None:
        return 0
    lengths, fitting = _fitting(trainer.eval_dataset, config)
    trainer.eval_dataset = trainer.eval_dataset.select(fitting)
    if not fitting:
        trainer.args.eval_strategy = "no"
    return len(lengths) - len(fitting)


def _fitting(pairs: Dataset, config: SftConfig) -> tuple[list[int], list[int]]:
    """The lengths of pairs in tokens, and the numbers of those that are not too long."""
    lengths = [len(tokens) for tokens in pairs["input_ids"]]
    return lengths, [i for i, length in enumerate(lengths) if length <= config.max_tokens]


def _last(history: Sequence[Mapping[str, Any]], name: str) -> float | None:
    return next((row[name] for row in reversed(history) if name in row), None)
