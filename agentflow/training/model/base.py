"""The model that training begins with, and saving what it becomes."""

from __future__ import annotations

import shutil
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from peft import AutoPeftModelForCausalLM, LoraConfig, OFTConfig
from transformers import AutoConfig, AutoModelForCausalLM, AutoTokenizer

from agentflow.errors import ConfigError
from agentflow.training.config import Adapter, TrainingConfig
from agentflow.training.model.folder import ModelFolder, find_model, read_folder
from agentflow.training.model.tiny import make_decoder, train_tokenizer

ADAPTER = "adapter_config.json"
"""The file that shows that a folder holds an adapter."""
PROCEDURAL = "procedural"
"""How the name of the procedural model, and of data made with it, begins."""


def base_folder(config: TrainingConfig, sources: Iterable[str]) -> ModelFolder:
    """What the folder of the trained model will say.

    Args:
        config: Its model, and its label if it has one.
        sources: Who wrote the data.
    """
    names = sorted(set(sources))
    procedural = all(name.startswith(PROCEDURAL) for name in names)
    data = "procedural data" if procedural else f"data of {' and '.join(names)}"
    if config.model.name is None:
        label, prompts = f"tiny model from scratch, {data}", "shorthand"
    else:
        base = read_base(config.model.name)
        label, prompts = f"{base.label}, fine-tuned on {data}", base.prompts
    return ModelFolder.model_validate({"label": config.label or label, "prompts": prompts})


def read_base(name: str) -> ModelFolder:
    """What a model says about itself; those of a hub are chat models.

    Raises:
        ConfigError: There is no such model, or its folder is damaged.
    """
    path = Path(name)
    if path.is_dir():
        return read_folder(path)
    try:
        AutoConfig.from_pretrained(name)
    except (OSError, ValueError):
        raise ConfigError(
            f"cannot load the model {name!r} (model.name): it is neither a folder nor the name of "
            "a model that is at hand here or at the Hugging Face hub"
        ) from None
    return ModelFolder(label=path.name)


def load_base(config: TrainingConfig, texts: Iterable[str]) -> tuple[Any, Any]:
    """The model to train, and its tokenizer. An adapter is merged into the model it belongs to.

    Args:
        config: Where it comes from.
        texts: What the tokenizer of a model from scratch is trained on.

    Raises:
        ConfigError: The named model cannot be loaded.
    """
    if config.model.tiny is not None:
        tokenizer = train_tokenizer(texts, config.model.tiny.vocabulary)
        return make_decoder(config.model.tiny, tokenizer), tokenizer
    path = Path(str(config.model.name))
    place = find_model(path) if path.is_dir() else path
    try:
        tokenizer = AutoTokenizer.from_pretrained(str(place))
        if (place / ADAPTER).is_file():
            model = AutoPeftModelForCausalLM.from_pretrained(str(place), dtype=config.precision)
            merged = model.merge_and_unload()
            return merged.requires_grad_(True), tokenizer  # adapters freeze what they belong to
        return AutoModelForCausalLM.from_pretrained(str(place), dtype=config.precision), tokenizer
    except OSError as error:
        why = str(error).strip().partition("\n")[0]
        raise ConfigError(f"cannot load the model {str(path)!r} (model.name): {why}") from None


def adapter_config(adapter: Adapter | None) -> Any:
    """PEFT's configuration of an adapter on all linear layers; None trains all weights."""
    if adapter is None:
        return None
    common = {"target_modules": "all-linear", "task_type": "CAUSAL_LM"}
    if adapter.oft is not None:
        return OFTConfig(r=0, oft_block_size=adapter.oft.block_size, **common)
    assert adapter.lora is not None
    lora = adapter.lora
    return LoraConfig(r=lora.rank, lora_alpha=lora.alpha, lora_dropout=lora.dropout, **common)


def save_model(model: Any, tokenizer: Any, folder: ModelFolder, path: Path) -> None:
    """Save a model, or its adapter, so that the folder is complete once it exists."""
    part = path.with_name(f"{path.name}.part")
    for old in (part, path):  # of a process that was killed
        shutil.rmtree(old, ignore_errors=True)
    model.save_pretrained(part)
    tokenizer.save_pretrained(part)
    folder.save(part)
    part.rename(path)
