"""Evaluates a model on tasks: asks for replies, judges them, writes the record."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from agentflow.api import design_prompt
from agentflow.app.design.config import find_unused_setting
from agentflow.app.design.models import charge_budget, choose_models, open_models
from agentflow.app.design.plan import physics_conditions
from agentflow.app.prompts import render_prompt
from agentflow.config.run import DesignConfig
from agentflow.env.pool.base import OpenPool
from agentflow.env.pool.pool import RolloutPool
from agentflow.env.tasks.registry import get_task
from agentflow.errors import (
    BudgetSpentError,
    ConfigError,
    EndpointError,
    InterruptedRunError,
    UsageError,
)
from agentflow.llm.wrappers.tape import Tape
from agentflow.metrics.intervals import missing_scipy
from agentflow.rewards.scoring import Sample, Scorer
from agentflow.runs import Notify
from agentflow.training.digests import digest_model
from agentflow.training.evaluation.models import ClientModel, EvaluatedModel, FolderModel
from agentflow.training.evaluation.record import (
    CALLS,
    Evaluation,
    EvaluationFolder,
    open_evaluation,
)
from agentflow.training.evaluation.replies import judge_async
from agentflow.training.libraries import require_libraries
from agentflow.training.record import ABOUT as TRAINING
from agentflow.training.record import read_training

if TYPE_CHECKING:
    from agentflow.training.model.loading import Sampler

ROLE = "designer"
"""The role whose prompt is answered."""
BATCH = 32
"""Replies that are asked for at once, then judged. A killed evaluation asks a folder's model for
the replies of its last batch again."""
Progress = Callable[[int, int], None]
"""(replies judged, of)."""
AGAIN = "run the same command again to continue"


def evaluate(
    config: DesignConfig,
    tasks: Sequence[str],
    samples: int,
    out: Path,
    *,
    name: str = "",
    notify: Notify = lambda _line: None,
    say: Progress = lambda _done, _of: None,
    open_pool: OpenPool = RolloutPool,
) -> Evaluation:
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
    if _folder(config) is not None:
        require_libraries("torch", "transformers")
    about = _describe(config, tasks, samples, name or out.resolve().name)
    if missing := missing_scipy():
        notify(missing)
    try:
        with open_evaluation(out, about) as folder:
            if folder.about.results is not None:
                return folder.about
            if folder.missing:
                asyncio.run(_carry_out(folder, config, open_pool, notify, say))
            return folder.finish()
    except KeyboardInterrupt:
        raise InterruptedRunError(f"interrupted; {AGAIN}") from None
    except EndpointError as error:
        raise type(error)(f"{error}; {AGAIN}") from error


def _describe(config: DesignConfig, tasks: Sequence[str], samples: int, name: str) -> Evaluation:
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
    briefs = [get_task(task, config.knobs, config.engine).brief for task in tasks]
    prompt, folder = render_prompt(config.prompts, ROLE, briefs[0]), _folder(config)
    return Evaluation(
        name=name,
        model=config.model.name,
        files=None if folder is None else digest_model(folder),
        label=choose_models(config.model)[ROLE].display_name,
        trained_on=_trained_on(config),
        tasks=tuple(tasks),
        samples=samples,
        seed=config.seed,
        sampling=config.model.sampling,
        prompts=f"{prompt['set']} {prompt['digest']}",
        knobs=config.knobs,
        conditions=physics_conditions(config.engine),
    )


def _folder(config: DesignConfig) -> Path | None:
    """The folder of the model, if it is one in a folder."""
    return None if config.model.label is None else Path(config.model.name)


def _trained_on(config: DesignConfig) -> tuple[str, ...]:
    """The tasks of the training run whose directory holds the model, if it names any."""
    folder = _folder(config)
    training = None if folder is None else folder.resolve().parent
    if training is None or not (training / TRAINING).exists():
        return ()
    return tuple(read_training(training).config.get("tasks", ()))


@dataclass(frozen=True)
class _Session:
    """One process at work on an evaluation."""

    folder: EvaluationFolder
    config: DesignConfig
    model: EvaluatedModel
    scorer: Scorer

    async def complete(self, say: Progress) -> None:
        """Add the replies that are missing, batch by batch."""
        about, replies = self.folder.about, self.folder.replies
        for place, task in enumerate(about.tasks):
            begin, end = place * about.samples, (place + 1) * about.samples
            for first in range(begin, end, BATCH):
                last = min(first + BATCH, end)
                if len(replies) < last:
                    texts = await self._ask(task, first - begin, last - first)
                    await self._judge(task, texts[len(replies) - first :])
                    say(len(replies), about.samples * len(about.tasks))

    async def _ask(self, task: str, first: int, count: int) -> list[str]:
        config = self.config
        prompt = design_prompt(
            task, knobs=config.knobs, engine=config.engine, prompts=config.prompts
        )
        return await self.model.answer(task, prompt, first, count)

    async def _judge(self, task: str, texts: Sequence[str]) -> None:
        config = self.config
        samples = [Sample(task, text, config.seed, config.knobs, config.engine) for text in texts]
        self.folder.add(await judge_async(samples, self.scorer))


async def _carry_out(
    folder: EvaluationFolder,
    config: DesignConfig,
    open_pool: OpenPool,
    notify: Notify,
    say: Progress,
) -> None:
    scorer = Scorer(config.workers, open_pool)
    try:
        async with _open_model(folder, config, notify) as model:
            await _Session(folder, config, model, scorer).complete(say)
    except BudgetSpentError as error:
        raise ConfigError(f"{error}: raise the limit in model.budget; {AGAIN}") from None
    finally:
        scorer.close()


@asynccontextmanager
async def _open_model(
    record: EvaluationFolder, config: DesignConfig, notify: Notify
) -> AsyncIterator[EvaluatedModel]:
    """The model, ready to answer; the calls of a client are recorded."""
    sampling, seed = config.model.sampling, config.seed
    if (folder := _folder(config)) is not None:
        yield FolderModel(_load_model(folder), sampling, seed)
        return
    with Tape(record.path / CALLS, notify) as tape:
        models = open_models(config, tape, charge_budget(config.model, tape), notify)
        try:
            yield ClientModel(models.clients[ROLE], sampling, seed)
        finally:
            await models.aclose()


def _load_model(folder: Path) -> Sampler:
    from agentflow.training.model.loading import load_model

    return load_model(folder)
