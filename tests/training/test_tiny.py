"""The tokenizer and the decoder of tiny models."""

# ruff: noqa: E402 - a check comes before imports of libraries that may be missing
from __future__ import annotations

import re

import pytest

from tests.training.libraries import require_training

pytestmark = require_training()

import torch

from agentflow.models.local.folder import END
from agentflow.training.config import TinyModel
from agentflow.training.model import make_decoder, train_tokenizer
from tests.training.sets import make_pairs

TEXTS = [pair.reply for pair in make_pairs("throwing", 30)]


def test_replies_survive_the_tokenizer() -> None:
    tokenizer = train_tokenizer(TEXTS, 400)
    for text in [*TEXTS, "  Räder 🛞\t3.14, ½\n\n```json\n[]```", "\u202e0٣", ""]:
        tokens = tokenizer(text)["input_ids"]
        assert tokenizer.decode(tokens) == text


def test_no_token_holds_digits_and_other_characters() -> None:
    tokenizer = train_tokenizer(TEXTS, 600)
    texts = [tokenizer.decode([token]) for token in range(len(tokenizer))]
    assert [text for text in texts if re.search(r"\d", text) and re.search(r"\D", text)] == []
    assert "12" in texts
    assert ', "face_id": ' in texts


def test_a_step_of_a_machine_has_eight_tokens() -> None:
    tokenizer = train_tokenizer(TEXTS, 600)
    step = '{"type": 63, "id": 11, "parent": 7, "face_id": 9},\n  '
    lengths = [len(tokenizer(step * count)["input_ids"]) for count in (2, 3)]
    assert lengths[1] - lengths[0] == 8


def test_the_end_of_a_prompt_is_one_token_that_no_reply_changes() -> None:
    tokenizer = train_tokenizer(TEXTS, 400)
    prompt = tokenizer(f"throw 0 1 36{END}")["input_ids"]
    assert tokenizer.decode(prompt[-1:]) == END
    for reply in (TEXTS[0], "7 wheels", " x"):
        both = tokenizer(f"throw 0 1 36{END}{reply}")["input_ids"]
        assert both[: len(prompt)] == prompt


def test_equal_texts_give_equal_tokenizers() -> None:
    assert train_tokenizer(TEXTS, 400).get_vocab() == train_tokenizer(TEXTS, 400).get_vocab()


@pytest.mark.parametrize("family", ["llama", "qwen"])
def test_a_decoder_has_the_configured_size(family: str) -> None:
    tokenizer = train_tokenizer(TEXTS, 400)
    config = TinyModel.model_validate(
        {"family": family, "hidden": 32, "layers": 2, "heads": 2, "feed_forward": 48}
    )
    torch.manual_seed(0)
    decoder = make_decoder(config, tokenizer)
    assert decoder.config.model_type.startswith(family)
    assert decoder.get_input_embeddings().weight.shape == (len(tokenizer), 32)
    layer = 4 * 32 * 32 + 3 * 32 * 48
    count = sum(parameter.numel() for parameter in decoder.parameters())
    assert 0 <= count - 2 * layer - len(tokenizer) * 32 < 300  # the rest: norms
    assert decoder.generation_config.eos_token_id == tokenizer.eos_token_id
