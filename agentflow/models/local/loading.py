"""Loads models from folders, samples replies, several at a time, and answers as a client."""

import asyncio
import hashlib
import time
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import torch
from transformers import AutoModelForCausalLM, AutoTokenizer

from agentflow.llm.messages import Finish, Reply, Request, Sampling, Usage
from agentflow.models.local.folder import Messages, ModelFolder, find_model, read_folder

BATCH = 64
"""Replies sampled at a time; more gain little speed on processors and need memory."""
MAX_TOKENS = 2048
"""Longest reply of a model without a limit of its own."""


class SampledReply(NamedTuple):
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

    def draw(self, messages: Messages, n: int, seed: int, sampling: Sampling) -> list[SampledReply]:
        """Sample n replies to one prompt; the same seed gives the same replies on one machine.

        Args:
            messages: The real prompt; a model with short prompts gets its short form.
            n: Number of replies.
            seed: Random seed.
            sampling: Its temperature, of which 0 takes the most likely token each time; `top_p`:
                only the most likely tokens with this sum of probabilities are drawn; and the
                longest reply, which None makes as long as the model can. The rest is not used.

        Raises:
            UsageError: The model cannot answer the prompt.
        """
        inputs = self._encode(messages).to(self.model.device)
        length = inputs["input_ids"].shape[1]
        options: dict[str, Any] = {
            "max_new_tokens": sampling.max_tokens or self._room_after(length),
            "do_sample": sampling.temperature > 0,
            "repetition_penalty": 1.0,  # chat models set one, and machines repeat block types
            "pad_token_id": self.tokenizer.pad_token_id,
        }
        if sampling.temperature:
            options |= {"temperature": sampling.temperature, "top_p": sampling.top_p, "top_k": 0}
        found: list[SampledReply] = []
        with torch.random.fork_rng(), torch.inference_mode():
            torch.manual_seed(seed)
            while len(found) < n:
                size = min(BATCH, n - len(found))
                batch = {key: value.repeat(size, 1) for key, value in inputs.items()}
                replies = self.model.generate(**batch, **options)[:, length:].tolist()
                found += map(self._read, replies)
        return found

    def _read(self, tokens: list[int]) -> SampledReply:
        ends = self.model.generation_config.eos_token_id
        ends = set(ends if isinstance(ends, list) else [ends])
        length = next((i for i, token in enumerate(tokens) if token in ends), None)
        text = self.tokenizer.decode(tokens[:length], skip_special_tokens=True)
        return SampledReply(text, len(tokens) if length is None else length, length is not None)

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


class LocalClient:
    """Answers requests with a model from a folder, one after the other."""

    def __init__(self, path: Path, seed: int) -> None:
        """Replies depend on `seed`, the request's sampling seed and its label.

        The model is loaded with the first request.
        """
        self._path, self._seed = path, seed
        self._turn = asyncio.Lock()
        self.name = read_folder(path).label

    async def complete(self, request: Request) -> Reply:
        """Answer one request; its stop words and form of reply are not used."""
        async with self._turn:
            return await asyncio.to_thread(self._answer, request)

    async def aclose(self) -> None:
        """Nothing to release."""

    @cached_property
    def _sampler(self) -> Sampler:
        return load_model(self._path)

    def _answer(self, request: Request) -> Reply:
        began = time.monotonic()
        messages = [{"role": m.role, "content": m.text} for m in request.messages]
        wanted = request.sampling
        name = f"{self._seed}/{wanted.seed}/{request.label}"
        seed = int.from_bytes(hashlib.sha256(name.encode()).digest()[:4], "big")
        (drawn,) = self._sampler.draw(messages, 1, seed, wanted)
        return Reply(
            text=drawn.text,
            finish=_finish(drawn),
            usage=Usage(completion=drawn.tokens),
            model=self.name,
            latency_s=round(time.monotonic() - began, 3),
        )


def _finish(drawn: SampledReply) -> Finish:
    if not drawn.complete:
        return "length"
    return "stop" if drawn.text.strip() else "empty"
