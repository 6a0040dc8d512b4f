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
    """A decoder made from scratch, with a tokenizer trained on the data."""

    family: Literal["llama", "qwen"] = Field("llama", description="architecture of the decoder")
    hidden: int = Field(192, ge=8, description="width of the hidden states")
    layers: int = Field(4, ge=1, description="number of decoder layers")
    heads: int = Field(4, ge=1, description="attention heads; must divide hidden")
    feed_forward: int = Field(512, ge=8, description="width of the feed-forward layers")
    positions: int = Field(512, ge=32, description="maximum tokens of prompt and reply together")
    vocabulary: int = Field(512, ge=300, description="maximum tokens of the tokenizer")

    @model_validator(mode="after")
    def _heads_fit(self) -> TinyModel:
        if self.hidden % self.heads or self.hidden // self.heads % 2:
            raise ValueError(
                f"hidden ({self.hidden}) must be an even multiple of heads ({self.heads})"
            )
        return self


class ModelSource(ConfigGroup):
    """Where training begins: a model from scratch, or one that exists."""

    tiny: TinyModel | None = None
    name: str | None = Field(None, min_length=1, description="name at a hub, or a folder")

    @model_validator(mode="after")
    def _has_one(self) -> ModelSource:
        if (self.tiny is None) == (self.name is None):
            raise ValueError(
                "give either tiny (a model from scratch) or name (a model of a hub, or a folder)"
            )
        return self


class Lora(ConfigGroup):
    """Low-rank adapters on all linear layers."""

    rank: int = Field(64, ge=1, description="rank of the adapter's matrices")
    alpha: float = Field(64.0, gt=0, description="the weight of the adapter is alpha / rank")
    dropout: float = Field(0.0, ge=0, lt=1, description="share of inputs dropped while training")


class Oft(ConfigGroup):
    """Orthogonal fine-tuning of all linear layers."""

    block_size: int = Field(64, ge=2, description="size of the orthogonal blocks")


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
    """How weights are updated."""

    name: Literal["adamw", "adamw_8bit"] = Field(
        "adamw", description="adamw_8bit stores its state in 8 bits and needs bitsandbytes"
    )
    learning_rate: float = Field(2e-3, gt=0, description="learning rate after the warm-up")
    schedule: Literal["cosine", "linear", "constant"] = Field(
        "cosine", description="how the learning rate changes after the warm-up"
    )
    warmup: float = Field(0.05, ge=0, lt=1, description="share of the steps; linear")
    weight_decay: float = Field(0.01, ge=0, description="decoupled weight decay")
    beta2: float = Field(0.98, gt=0, lt=1, description="memory of squared gradients")
    gradient_norm: float = Field(1.0, gt=0, description="longer gradients are shortened to this")


class TrainingConfig(ConfigGroup):
    """What all kinds of training have in common."""

    model: ModelSource
    peft: Adapter | None = Field(None, description="None trains all weights")
    optimiser: Optimiser = Optimiser()
    steps: int = Field(ge=1, description="number of updates")
    seed: int = Field(0, ge=0, lt=2**32, description="random seed")
    precision: Literal["float32", "bfloat16"] = Field(
        "float32", description="number format of weights and activations"
    )
    device: Literal["auto", "cpu"] = Field(
        "auto", description="device; auto takes a GPU if there is one"
    )
    threads: int | None = Field(None, ge=1, description="processor threads; None is all")
    log_every: int = Field(10, ge=1, description="steps between lines of the curves")
    save_every: int = Field(100, ge=1, description="steps between checkpoints")
    label: str | None = Field(None, min_length=1, description="name in results; None derives it")

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
    """Supervised fine-tuning on pairs of prompt and reply."""

    data: str = Field(min_length=1, description="folder with train.jsonl and dev.jsonl")
    batch: int = Field(32, ge=1, description="pairs per update")
    device_batch: int | None = Field(
        None, ge=1, description="pairs per device at a time; None is the whole batch"
    )
    max_tokens: int = Field(512, ge=16, description="longer pairs are left out")
    dev_every: int = Field(100, ge=1, description="steps between losses on dev.jsonl")
    dev_pairs: int = Field(128, ge=1, description="maximum pairs of dev.jsonl to use")

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
