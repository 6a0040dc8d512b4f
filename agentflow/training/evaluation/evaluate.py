"""Evaluates a model on tasks: what answers, its replies, their judgement, the record."""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable, Sequence
from contextlib import asynccontextmanager, closing
from functools import partial
from pathlib import Path

import numpy as np

from agentflow.agents.base import chat_prompt
from agentflow.agents.designer import Designer
from agentflow.config.run import DesignConfig
from agentflow.env.physics.engines import physics_conditions
from agentflow.env.pool.pool import OpenPool, RolloutPool
from agentflow.env.tasks.registry import get_task
from agentflow.errors import UsageError
from agentflow.llm.messages import Client, Message, Request, Sampling
from agentflow.metrics.intervals import missing_scipy
from agentflow.models.choices import choose_models, continuable, recorded_models
from agentflow.models.completion import find_unused_setting
from agentflow.models.local.folder import Messages
from agentflow.models.local.libraries import require_libraries
from agentflow.progress import Progress, silent
from agentflow.prompts.render import PromptSet
from agentflow.rewards import Sample, Scorer
from agentflow.runs import Notify
from agentflow.search.concurrency import work_in_order
from agentflow.training.evaluation.record import EvaluationFolder, EvaluationRecord, open_evaluation
from agentflow.training.evaluation.replies import judge_async
from agentflow.training.record import ABOUT as TRAINING
from agentflow.training.record import digest_model, read_training

ROLE = Designer.name


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


BATCH = 32
"""Replies that are asked for at once, then judged. A killed evaluation asks a folder's model for
the replies of its last batch again."""


def evaluate(
    config: DesignConfig,
    tasks: Sequence[str],
    samples: int,
    out: Path,
    *,
    name: str = "",
    notify: Notify = lambda _line: None,
    say: Progress = silent,
    open_pool: OpenPool = RolloutPool,
) -> EvaluationRecord:
    """Evaluate the configured model on tasks; continue an interrupted evaluation.

    Args:
        config: Model, sampling, seed, prompts, knobs, engine and workers; the rest is not used.
        tasks: Levels, such as "throwing/3".
        samples: Replies to each.
        out: Directory of the evaluation; created if missing.
        name: Name of the row in tables; by default that of the directory.
        notify: Receives remarks for the user.
        say: Receives progress.
        open_pool: Opens a pool of simulating processes.

    Returns:
        What is written to evaluation.json.

    Raises:
        UsageError: A task or value is wrong, or the directory holds something else.
        EndpointError: The model cannot be used; what it has answered is kept.
        InterruptedRunError: Ctrl-C.
    """
    if choose_models(config.model)[ROLE].folder is not None:
        require_libraries("torch", "transformers")
    about = _describe(config, tasks, samples, name or out.resolve().name)
    if missing := missing_scipy():
        notify(missing)
    with continuable(), open_evaluation(out, about) as folder:
        if folder.about.results is not None:
            return folder.about
        if folder.missing:
            asyncio.run(_carry_out(folder, config, open_pool, notify, say))
        return folder.finish()


def _describe(
    config: DesignConfig, tasks: Sequence[str], samples: int, name: str
) -> EvaluationRecord:
    """Everything that decides the results, with every name looked up."""
    if samples < 1:
        raise UsageError(f"an evaluation needs at least one sample of each task, not {samples}")
    if len(set(tasks)) < len(tasks):
        raise UsageError(f"each task may be named once, not as in {', '.join(tasks)}")
    if key := find_unused_setting(config):
        raise UsageError(
            f"an evaluation has no {key}: it asks for whole machines, each in one reply; set only "
            "keys of model, knobs, prompts and engine"
        )
    for task in tasks:
        get_task(task, config.knobs, config.engine)  # it exists
    choice = choose_models(config.model)[ROLE]
    return EvaluationRecord(
        name=name,
        model=choice.model,
        files=None if choice.folder is None else digest_model(choice.folder),
        label=choice.display_name,
        trained_on=() if choice.folder is None else _trained_on(choice.folder),
        tasks=tuple(tasks),
        samples=samples,
        seed=config.seed,
        sampling=choice.sampling,
        prompts=f"{config.prompts} {PromptSet(config.prompts).digest}",
        knobs=config.knobs,
        conditions=physics_conditions(config.engine),
    )


def _trained_on(folder: Path) -> tuple[str, ...]:
    """The tasks of the training run whose directory holds the model, if it names any."""
    training = folder.resolve().parent
    if not (training / TRAINING).exists():
        return ()
    return tuple(read_training(training).config.get("tasks", ()))


async def _carry_out(
    folder: EvaluationFolder,
    config: DesignConfig,
    open_pool: OpenPool,
    notify: Notify,
    say: Progress,
) -> None:
    """Add the replies that are missing, batch by batch."""
    about, replies = folder.about, folder.replies
    with closing(Scorer(config.workers, open_pool)) as scorer:
        async with open_model(config, folder.path, notify) as answer:
            for place, task in enumerate(about.tasks):
                brief = get_task(task, config.knobs, config.engine).brief
                prompt = chat_prompt(Designer, brief, config.prompts)
                given = (config.seed, config.knobs, config.engine)
                begin, end = place * about.samples, (place + 1) * about.samples
                for first in range(begin, end, BATCH):
                    last = min(first + BATCH, end)
                    if len(replies) < last:
                        texts = await answer(task, prompt, first - begin, last - first)
                        new = [Sample(task, text, *given) for text in texts[len(replies) - first :]]
                        folder.add(await judge_async(new, scorer))
                        say(len(replies), about.samples * len(about.tasks))
