"""A model in a folder as a client: it answers in this process."""

from __future__ import annotations

import asyncio
import hashlib
import time
from functools import cached_property
from pathlib import Path

from agentflow.llm.messages import Finish, Reply, Request, Usage
from agentflow.training.model.folder import read_folder
from agentflow.training.model.loading import Sample, Sampler, load_model


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
        (drawn,) = self._sampler.draw(
            messages, 1, seed, wanted.temperature, wanted.top_p, wanted.max_tokens
        )
        return Reply(
            text=drawn.text,
            finish=_finish(drawn),
            usage=Usage(completion=drawn.tokens),
            model=self.name,
            latency_s=round(time.monotonic() - began, 3),
        )


def _finish(drawn: Sample) -> Finish:
    if not drawn.complete:
        return "length"
    return "stop" if drawn.text.strip() else "empty"
