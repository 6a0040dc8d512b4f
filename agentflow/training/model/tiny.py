"""A tiny model from scratch: byte-level BPE trained on the data, and a decoder from its config."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from tokenizers import Regex, Tokenizer, decoders, models, pre_tokenizers, trainers
from transformers import (
    LlamaConfig,
    LlamaForCausalLM,
    PreTrainedTokenizerFast,
    Qwen3Config,
    Qwen3ForCausalLM,
)

from agentflow.training.config import TinyModel
from agentflow.training.model.shorthand import END

PAD, EOS = "<pad>", "<eos>"
_DIGITS_OR_OTHERS = r"\d+|\D+"
_FAMILIES = {
    "llama": (LlamaConfig, LlamaForCausalLM),
    "qwen": (Qwen3Config, Qwen3ForCausalLM),
}


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
