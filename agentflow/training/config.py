"""Configurations of training, read from YAML files, options and `--set`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Literal, TypeVar

from pydantic import BaseModel, Field, ValidationError, model_validator

from agentflow.config.run import load_mapping, split_setting
from agentflow.errors import ConfigError
from agentflow.files.faults import explain, find_bool_as_number
from agentflow.files.yaml import deep_merge, nest_keys


class ConfigGroup(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """Keys of a configuration; no others, no changes later."""


class TinyModel(ConfigGroup):
    """A decoder made from scratch, with a tokenizer trained on the data.

    Attributes:
        family: Architecture of the decoder.
        hidden: Width of the hidden states.
        layers: Number of decoder layers.
        heads: Attention heads; must divide hidden.
        feed_forward: Width of the feed-forward layers.
        positions: Maximum tokens of prompt and reply together.
        vocabulary: Maximum tokens of the tokenizer.
    """

    family: Literal["llama", "qwen"] = "llama"
    hidden: int = Field(192, ge=8)
    layers: int = Field(4, ge=1)
    heads: int = Field(4, ge=1)
    feed_forward: int = Field(512, ge=8)
    positions: int = Field(512, ge=32)
    vocabulary: int = Field(512, ge=300)

    @model_validator(mode="after")
    def _heads_fit(self) -> TinyModel:
        if self.hidden % self.heads or self.hidden // self.heads % 2:
            raise ValueError(
                f"hidden ({self.hidden}) must be an even multiple of heads ({self.heads})"
            )
        return self


class ModelSource(ConfigGroup):
    """Where training begins: a model from scratch, or one that exists.

    Attributes:
        name: Name at a hub, or a folder.
    """

    tiny: TinyModel | None = None
    name: str | None = Field(None, min_length=1)

    @model_validator(mode="after")
    def _has_one(self) -> ModelSource:
        if (self.tiny is None) == (self.name is None):
            raise ValueError(
                "give either tiny (a model from scratch) or name (a model of a hub, or a folder)"
            )
        return self


class Lora(ConfigGroup):
    """Low-rank adapters on all linear layers.

    Attributes:
        rank: Rank of the adapter's matrices.
        alpha: The weight of the adapter is alpha / rank.
        dropout: Share of inputs dropped while training.
    """

    rank: int = Field(64, ge=1)
    alpha: float = Field(64.0, gt=0)
    dropout: float = Field(0.0, ge=0, lt=1)


class Oft(ConfigGroup):
    """Orthogonal fine-tuning of all linear layers.

    Attributes:
        block_size: Size of the orthogonal blocks.
    """

    block_size: int = Field(64, ge=2)


class Adapter(ConfigGroup):
    """Trains a few additional parameters; those of the model stay as they are."""

    lora: Lora | None = None
    oft: Oft | None = None

    @model_validator(mode="after")
    def _has_one(self) -> Adapter:
        if (self.lora is None) == (self.oft is None):
            raise ValueError("give either lora or oft")
        return self


class Optimiser(ConfigGroup):
    """How weights are updated.

    Attributes:
        name: adamw_8bit stores its state in 8 bits and needs bitsandbytes.
        learning_rate: Learning rate after the warm-up.
        schedule: How the learning rate changes after the warm-up.
        warmup: Share of the steps; linear.
        weight_decay: Decoupled weight decay.
        beta2: Memory of squared gradients.
        gradient_norm: Longer gradients are shortened to this.
    """

    name: Literal["adamw", "adamw_8bit"] = "adamw"
    learning_rate: float = Field(2e-3, gt=0)
    schedule: Literal["cosine", "linear", "constant"] = "cosine"
    warmup: float = Field(0.05, ge=0, lt=1)
    weight_decay: float = Field(0.01, ge=0)
    beta2: float = Field(0.98, gt=0, lt=1)
    gradient_norm: float = Field(1.0, gt=0)


class TrainingConfig(ConfigGroup):
    """What all kinds of training have in common.

    Attributes:
        peft: None trains all weights.
        steps: Number of updates.
        seed: Random seed.
        precision: Number format of weights and activations.
        device: Device; auto takes a GPU if there is one.
        threads: Processor threads; None is all.
        log_every: Steps between lines of the curves.
        save_every: Steps between checkpoints.
        label: Name in results; None derives it.
    """

    model: ModelSource
    peft: Adapter | None = None
    optimiser: Optimiser = Optimiser()
    steps: int = Field(ge=1)
    seed: int = Field(0, ge=0, lt=2**32)
    precision: Literal["float32", "bfloat16"] = "float32"
    device: Literal["auto", "cpu"] = "auto"
    threads: int | None = Field(None, ge=1)
    log_every: int = Field(10, ge=1)
    save_every: int = Field(100, ge=1)
    label: str | None = Field(None, min_length=1)

    @property
    def libraries(self) -> tuple[str, ...]:
        """What must be installed."""
        eight_bit = self.optimiser.name == "adamw_8bit"
        return ("torch", "transformers", "trl", "datasets", "peft", *["bitsandbytes"] * eight_bit)

    @model_validator(mode="after")
    def _saves_between_lines(self) -> TrainingConfig:
        if self.save_every % self.log_every:  # else a continued run would have another line
            raise ValueError(
                f"save_every ({self.save_every}) must be a multiple of log_every ({self.log_every})"
            )
        return self


class SftConfig(TrainingConfig):
    """Supervised fine-tuning on pairs of prompt and reply.

    Attributes:
        data: Folder with train.jsonl and dev.jsonl.
        batch: Pairs per update.
        device_batch: Pairs per device at a time; None is the whole batch.
        max_tokens: Longer pairs are left out.
        dev_every: Steps between losses on dev.jsonl.
        dev_pairs: Maximum pairs of dev.jsonl to use.
    """

    data: str = Field(min_length=1)
    batch: int = Field(32, ge=1)
    device_batch: int | None = Field(None, ge=1)
    max_tokens: int = Field(512, ge=16)
    dev_every: int = Field(100, ge=1)
    dev_pairs: int = Field(128, ge=1)

    @model_validator(mode="after")
    def _fits(self) -> SftConfig:
        tiny = self.model.tiny
        if tiny is not None and self.max_tokens > tiny.positions:
            raise ValueError(
                f"max_tokens ({self.max_tokens}) must be at most model.tiny.positions "
                f"({tiny.positions})"
            )
        if self.batch % (self.device_batch or self.batch):
            raise ValueError(
                f"batch ({self.batch}) must be a multiple of device_batch ({self.device_batch})"
            )
        return self


Kind = TypeVar("Kind", bound=TrainingConfig)


def read_config(
    kind: type[Kind], path: Path, settings: Iterable[str], options: Mapping[str, Any]
) -> Kind:
    """Read a configuration; options override `--set`, which overrides the file.

    Args:
        kind: What is configured.
        path: The YAML file.
        settings: Strings `a.b=value`.
        options: Dotted keys; None means not given.

    Raises:
        ConfigError: The file cannot be read, or a key is wrong; the message names it.
    """
    given = [split_setting(setting) for setting in settings]
    given += [(key, value) for key, value in options.items() if value is not None]
    document = load_mapping(path)
    for key, value in given:
        document = deep_merge(document, nest_keys({key: value}))
    try:
        found = kind.model_validate(document)
    except ValidationError as error:
        raise ConfigError(explain(error, kind, "configuration key")) from None
    if place := find_bool_as_number(document, found.model_dump()):
        raise ConfigError(f"{place}: expected a number, not true or false")
    return found
