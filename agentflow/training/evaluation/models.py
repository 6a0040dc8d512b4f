"""What answers in an evaluation: a client of an endpoint, the procedural model, or a folder."""

from __future__ import annotations

from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from functools import partial
from pathlib import Path

import numpy as np

from agentflow.agents.designer import Designer
from agentflow.config.run import DesignConfig
from agentflow.llm.client import Client
from agentflow.llm.messages import Message, Request, Sampling
from agentflow.models.choices import choose_models
from agentflow.models.clients import recorded_models
from agentflow.models.local.folder import Messages
from agentflow.runs import Notify
from agentflow.search.concurrency import work_in_order

ROLE = Designer.name
"""The role whose prompt is answered."""


Answer = Callable[[str, Messages, int, int], Awaitable[list[str]]]
"""Returns the replies with these numbers to the prompt of a task: its name, the prompt, the first
number and their count. The same numbers give the same replies, as far as the model can repeat
itself."""


@asynccontextmanager
async def open_model(config: DesignConfig, out: Path, notify: Notify) -> AsyncIterator[Answer]:
    """The model, ready to answer; the calls of a client are recorded in the folder `out`."""
    choice, seed = choose_models(config.model)[ROLE], config.seed
    if choice.folder is not None:
        yield _answer_from_folder(choice.folder, choice.sampling, seed)
        return
    async with recorded_models(config, out, notify) as models:
        yield partial(_ask_client, models.clients[ROLE], choice.sampling, seed)


async def _ask_client(
    client: Client,
    sampling: Sampling,
    seed: int,
    task: str,
    messages: Messages,
    first: int,
    count: int,
) -> list[str]:
    """Ask for all replies at once, each in a request of its own."""
    given = tuple(
        Message.model_validate({"role": message["role"], "text": message["content"]})
        for message in messages
    )

    async def ask(number: int) -> str:
        own = sampling.model_copy(update={"seed": random_seed(seed, task, number)})
        label = f"{task}/sample-{number}"
        request = Request(role=ROLE, label=label, messages=given, sampling=own)
        return (await client.complete(request)).text

    texts: list[str] = []
    await work_in_order(range(first, first + count), ask, texts.append, count)
    return texts


def _answer_from_folder(path: Path, sampling: Sampling, seed: int) -> Answer:
    """Sample the replies of a model in a folder, a batch at once."""
    from agentflow.models.local.loading import load_model

    sampler = load_model(path)

    async def answer(task: str, messages: Messages, first: int, count: int) -> list[str]:
        drawn = sampler.draw(messages, count, random_seed(seed, task, first), sampling)
        return [found.text for found in drawn]

    return answer


def random_seed(seed: int, task: str, number: int) -> int:
    """A seed of a reply, or of a batch: 31 bits, which every endpoint takes."""
    words = [abs(seed), seed < 0, number, *task.encode()]
    return int(np.random.SeedSequence(words).generate_state(1)[0] >> 1)
