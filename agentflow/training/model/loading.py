"""Loads models from folders and samples replies, several at a time."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import torch
from transformers import AutoModelForCausalLM, AutoTokenizer

from agentflow.training.model.folder import Messages, ModelFolder, find_model, read_folder

BATCH = 64
"""Replies sampled at a time; more gain little speed on processors and need memory."""
MAX_TOKENS = 2048
"""Longest reply of a model without a limit of its own."""


class Sample(NamedTuple):
    """A sampled reply."""

    text: str
    tokens: int
    """Its length."""
    complete: bool
    """Whether the model ended it; otherwise it was cut off."""


@dataclass(frozen=True)
class Sampler:
    """A loaded model that answers prompts."""

    folder: ModelFolder
    model: Any
    tokenizer: Any

    def sample(
        self,
        messages: Messages,
        n: int,
        seed: int,
        temperature: float = 1.0,
        top_p: float = 1.0,
        max_tokens: int | None = None,
    ) -> list[str]:
        """The texts of `draw`."""
        drawn = self.draw(messages, n, seed, temperature, top_p, max_tokens)
        return [found.text for found in drawn]

    def draw(
        self,
        messages: Messages,
        n: int,
        seed: int,
        temperature: float = 1.0,
        top_p: float = 1.0,
        max_tokens: int | None = None,
    ) -> list[Sample]:
        """Sample n replies to one prompt; the same seed gives the same replies on one machine.

        Args:
            messages: The real prompt; a model with short prompts gets its short form.
            n: Number of replies.
            seed: Random seed.
            temperature: 0 takes the most likely token each time.
            top_p: Only the most likely tokens with this sum of probabilities are drawn.
            max_tokens: Longest reply; None is as long as the model can.

        Raises:
            UsageError: The model cannot answer the prompt.
        """
        inputs = self._encode(messages).to(self.model.device)
        length = inputs["input_ids"].shape[1]
        options = {
            "max_new_tokens": max_tokens or self._room_after(length),
            "do_sample": temperature > 0,
            "repetition_penalty": 1.0,  # chat models set one, and machines repeat block types
            "pad_token_id": self.tokenizer.pad_token_id,
            **({"temperature": temperature, "top_p": top_p, "top_k": 0} if temperature else {}),
        }
        found: list[Sample] = []
        with torch.random.fork_rng(), torch.inference_mode():
            torch.manual_seed(seed)
            while len(found) < n:
                size = min(BATCH, n - len(found))
                batch = {key: value.repeat(size, 1) for key, value in inputs.items()}
                replies = self.model.generate(**batch, **options)[:, length:].tolist()
                found += map(self._read, replies)
        return found

    def _read(self, tokens: list[int]) -> Sample:
        ends = self.model.generation_config.eos_token_id
        ends = set(ends if isinstance(ends, list) else [ends])
        length = next((i for i, token in enumerate(tokens) if token in ends), None)
        text = self.tokenizer.decode(tokens[:length], skip_special_tokens=True)
        return Sample(text, len(tokens) if length is None else length, length is not None)

    def _encode(self, messages: Messages) -> Any:
        prompt = self.folder.prompt(messages)
        if isinstance(prompt, str):
            return self.tokenizer(prompt, return_tensors="pt", return_token_type_ids=False)
        return self.tokenizer.apply_chat_template(
            prompt, add_generation_prompt=True, return_dict=True, return_tensors="pt"
        )

    def _room_after(self, length: int) -> int:
        most = getattr(self.model.config, "max_position_embeddings", length + MAX_TOKENS)
        return max(1, min(MAX_TOKENS, most - length))


def load_model(path: Path, device: str | None = None) -> Sampler:
    """Load a model folder.

    Args:
        path: The folder of a model, or of an adapter to a model.
        device: Such as "cpu" or "cuda"; None takes a GPU if there is one.

    Raises:
        ConfigError: It is not the folder of a model.
    """
    path, folder = find_model(path), read_folder(path)
    where = device or ("cuda" if torch.cuda.is_available() else "cpu")
    tokenizer = AutoTokenizer.from_pretrained(path)
    if tokenizer.pad_token_id is None:
        tokenizer.pad_token = tokenizer.eos_token
    model = AutoModelForCausalLM.from_pretrained(path, dtype="auto").to(where).eval()
    return Sampler(folder, model, tokenizer)
