"""The model that training begins with: one that exists, or a tiny one from scratch."""

import shutil
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from peft import AutoPeftModelForCausalLM, LoraConfig, OFTConfig
from tokenizers import Regex, Tokenizer, decoders, models, pre_tokenizers, trainers
from transformers import (
    AutoConfig,
    AutoModelForCausalLM,
    AutoTokenizer,
    LlamaConfig,
    LlamaForCausalLM,
    PreTrainedTokenizerFast,
    Qwen3Config,
    Qwen3ForCausalLM,
)

from agentflow.errors import ConfigError
from agentflow.models.local.folder import END, ModelFolder, find_model, read_folder
from agentflow.training.config import Adapter, TinyModel, TrainingConfig

PAD, EOS = "<pad>", "<eos>"
_DIGITS_OR_OTHERS = r"\d+|\D+"
_FAMILIES = {"llama": (LlamaConfig, LlamaForCausalLM), "qwen": (Qwen3Config, Qwen3ForCausalLM)}


def train_tokenizer(texts: Iterable[str], size: int) -> PreTrainedTokenizerFast:
    """Train byte-level BPE in which no token holds digits and other characters.

    A number is then one token wherever it stands, and the text between two numbers is one as well:
    a reply of 486 tokens of GPT-2's kind has 167.

    Args:
        texts: What it will read and write.
        size: Most tokens; 256 are bytes.
    """
    tokenizer = Tokenizer(models.BPE())
    tokenizer.pre_tokenizer = pre_tokenizers.Sequence(
        [
            pre_tokenizers.Split(Regex(_DIGITS_OR_OTHERS), "isolated"),
            pre_tokenizers.ByteLevel(add_prefix_space=False, use_regex=False),
        ]
    )
    tokenizer.decoder = decoders.ByteLevel()
    trainer = trainers.BpeTrainer(
        vocab_size=size,
        special_tokens=[PAD, EOS, END],
        initial_alphabet=pre_tokenizers.ByteLevel.alphabet(),
        show_progress=False,
    )
    tokenizer.train_from_iterator(texts, trainer)
    return PreTrainedTokenizerFast(
        tokenizer_object=tokenizer,
        pad_token=PAD,
        eos_token=EOS,
        additional_special_tokens=[END],
        padding_side="left",
        clean_up_tokenization_spaces=False,
    )


def make_decoder(config: TinyModel, tokenizer: PreTrainedTokenizerFast) -> Any:
    """A decoder with random weights; seed torch first."""
    config_type, model_type = _FAMILIES[config.family]
    return model_type(
        config_type(
            vocab_size=len(tokenizer),
            hidden_size=config.hidden,
            num_hidden_layers=config.layers,
            num_attention_heads=config.heads,
            num_key_value_heads=config.heads,
            head_dim=config.hidden // config.heads,
            intermediate_size=config.feed_forward,
            max_position_embeddings=config.positions,
            tie_word_embeddings=True,
            pad_token_id=tokenizer.pad_token_id,
            eos_token_id=tokenizer.eos_token_id,
            bos_token_id=None,
        )
    )


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
            "a model that is available here or on the Hugging Face hub"
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
