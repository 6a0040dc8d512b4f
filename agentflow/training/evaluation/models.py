"""What answers in an evaluation: a client of an endpoint, the procedural model, or a folder."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING, Protocol

import numpy as np

from agentflow.llm.client import Client
from agentflow.llm.messages import Message, Request, Sampling
from agentflow.training.model.folder import Messages

if TYPE_CHECKING:
    from agentflow.training.model.loading import Sampler


class EvaluatedModel(Protocol):
    """Answers a prompt again and again."""

    async def answer(self, task: str, messages: Messages, first: int, count: int) -> list[str]:
        """The replies with these numbers to the prompt of a task.

        The same numbers give the same replies, as far as the model can repeat itself.
        """


class ClientModel:
    """A client's replies, each to a request of its own."""

    def __init__(self, client: Client, sampling: Sampling, seed: int) -> None:
        self._client, self._sampling, self._seed = client, sampling, seed

    async def answer(self, task: str, messages: Messages, first: int, count: int) -> list[str]:
        """Ask for all replies at once; an error is raised when every call has ended."""
        given = tuple(
            Message.model_validate({"role": message["role"], "text": message["content"]})
            for message in messages
        )

        async def ask(number: int) -> str:
            seed = random_seed(self._seed, task, number)
            sampling = self._sampling.model_copy(update={"seed": seed})
            label = f"{task}/sample-{number}"
            request = Request(role="designer", label=label, messages=given, sampling=sampling)
            return (await self._client.complete(request)).text

        calls = asyncio.gather(*map(ask, range(first, first + count)), return_exceptions=True)
        texts: list[str] = []
        for found in await calls:
            if isinstance(found, BaseException):
                raise found
            texts.append(found)
        return texts


class FolderModel:
    """The replies of a model in a folder, a batch at once."""

    def __init__(self, sampler: Sampler, sampling: Sampling, seed: int) -> None:
        self._sampler, self._sampling, self._seed = sampler, sampling, seed

    async def answer(self, task: str, messages: Messages, first: int, count: int) -> list[str]:
        """Sample one batch."""
        sampling = self._sampling
        return self._sampler.sample(
            messages,
            count,
            random_seed(self._seed, task, first),
            sampling.temperature,
            sampling.top_p,
            sampling.max_tokens,
        )


def random_seed(seed: int, task: str, number: int) -> int:
    """A seed of a reply, or of a batch: 31 bits, which every endpoint takes."""
    words = [abs(seed), seed < 0, number, *task.encode()]
    return int(np.random.SeedSequence(words).generate_state(1)[0] >> 1)
