"""Writes a tiny language model with random weights; runs in `.venv-decoder`, downloads nothing.

Its tokens are single characters and it has no end token: only `max_tokens` or `stop` end a reply.
"""

from __future__ import annotations

import string
import sys

import torch
from tokenizers import Regex, Tokenizer, decoders, models, pre_tokenizers
from transformers import LlamaConfig, LlamaForCausalLM, PreTrainedTokenizerFast

CHARACTERS = string.ascii_letters + string.digits + string.punctuation + " \n"
TEMPLATE = "{% for message in messages %}{{ message.content }}\n{% endfor %}"


def write(folder: str) -> None:
    """Weights, tokenizer and chat template in the layout of a model folder."""
    tokens = {token: number for number, token in enumerate(["<unk>", *CHARACTERS])}
    tokenizer = Tokenizer(models.WordLevel(tokens, unk_token="<unk>"))
    tokenizer.pre_tokenizer = pre_tokenizers.Split(Regex(r"[\s\S]"), "isolated")
    tokenizer.decoder = decoders.Fuse()
    saved = PreTrainedTokenizerFast(tokenizer_object=tokenizer, unk_token="<unk>")
    saved.chat_template = TEMPLATE
    saved.save_pretrained(folder)
    torch.manual_seed(0)
    config = LlamaConfig(
        vocab_size=len(tokens),
        hidden_size=32,
        intermediate_size=64,
        num_hidden_layers=2,
        num_attention_heads=2,
        max_position_embeddings=1024,
        bos_token_id=None,
        eos_token_id=None,
        pad_token_id=0,
    )
    model = LlamaForCausalLM(config)
    model.generation_config.do_sample = True
    model.generation_config.bad_words_ids = [[0]]  # never <unk>
    model.save_pretrained(folder)


if __name__ == "__main__":
    write(sys.argv[1])
