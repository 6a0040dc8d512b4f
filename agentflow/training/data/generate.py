"""Ask a model for machines for design objectives, and record its answers."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from itertools import islice
from pathlib import Path
from random import Random
from typing import Any

from agentflow.agents.base import chat_prompt
from agentflow.agents.designer import Designer
from agentflow.config.run import DesignConfig
from agentflow.errors import BudgetSpentError, UsageError
from agentflow.files.lines import require_planned
from agentflow.llm.client import Client
from agentflow.llm.messages import Request, Sampling
from agentflow.machine import Brief, check
from agentflow.models.choices import choose_models
from agentflow.models.clients import recorded_models
from agentflow.progress import Progress
from agentflow.runs import Notify
from agentflow.search.concurrency import work_in_order
from agentflow.training.data.answers import (
    ANSWERS,
    Answer,
    AnswerPlan,
    ObjectivePrompt,
    split_reply,
)
from agentflow.training.data.folder import (
    open_log,
    work_in,
)
from agentflow.training.data.pairs import make_prompt
from agentflow.training.data.variants import make_variants
from agentflow.training.objectives import Objective

ROLE = Designer.name
USED = frozenset({"model", "prompts", "seed"})
"""Keys of a configuration that decide answers; an objective has everything else."""


def plan_answers(
    objectives: Sequence[Objective],
    config: DesignConfig,
    *,
    samples: int,
    limit: int | None = None,
    variants: float = 0.0,
) -> AnswerPlan:
    """The plan of answers by the designer's model of a configuration.

    Args:
        objectives: What to ask for.
        config: Its model, prompt set and seed count.
        samples: Answers to each objective.
        limit: Maximum number of answers.
        variants: Machines made by random edits for each answer with a valid machine, on average.

    Raises:
        UsageError: The configuration has keys that decide nothing here.
    """
    if unused := sorted(config.model_fields_set - USED):
        raise UsageError(
            f"answers to objectives have no {unused[0]}: set only keys of model, prompts and seed"
        )
    choice = choose_models(config.model)[ROLE]
    return AnswerPlan(
        model=choice.display_name,
        sampling=choice.sampling.model_dump(mode="json"),
        seed=config.seed,
        samples=samples,
        limit=limit,
        variants=variants,
        questions=tuple(_ask_for(item, config.prompts) for item in objectives),
    )


def _ask_for(objective: Objective, prompts: str) -> ObjectivePrompt:
    prompt = make_prompt(chat_prompt(Designer, objective.task.brief, prompts))
    return ObjectivePrompt(objective=objective, prompt=prompt)


def generate(
    plan: AnswerPlan, config: DesignConfig, out: Path, workers: int, notify: Notify, show: Progress
) -> dict[str, Any]:
    """Record the answers of a plan in a folder, or those that it lacks.

    Args:
        plan: From `plan_answers`.
        config: How to reach the model, its budget and limits.
        out: The folder.
        workers: Requests at a time.
        notify: Receives remarks about the endpoint.
        show: Receives the progress.

    Returns:
        `out`, `model`, `answers` (in the folder), `planned`, `variants`, `calls`, `tokens`, `cost`
        and `stopped` (why before the end; None if it is complete).

    Raises:
        RunError: The folder holds something else, is in use, or cannot be written.
        EndpointError: The model cannot be used; the same command continues.
        InterruptedRunError: Ctrl-C; the same command continues.
    """
    with work_in(out, plan, ANSWERS):
        return asyncio.run(_carry_out(plan, config, out, workers, notify, show))


async def _carry_out(
    plan: AnswerPlan, config: DesignConfig, out: Path, workers: int, notify: Notify, show: Progress
) -> dict[str, Any]:
    async with recorded_models(config, out, notify) as models:
        work = _Work(plan, models.clients[ROLE], show)
        stopped = await work.complete(out / ANSWERS, workers)
        return {
            "out": str(out),
            "model": plan.model,
            "answers": work.done,
            "planned": plan.count,
            "variants": work.variants,
            **models.budget.to_json(),
            "stopped": stopped,
        }


class _Work:
    """The answers of one folder."""

    def __init__(self, plan: AnswerPlan, client: Client, show: Progress) -> None:
        self._plan, self._client, self._show = plan, client, show
        self._briefs = {item.objective.name: item.objective.task.brief for item in plan.questions}
        self.done = self.variants = 0

    async def complete(self, file: Path, workers: int) -> str | None:
        """Record the answers that are missing; why it stopped before the end, or None."""
        with open_log(file, Answer) as (lines, known):
            asked = ((question.objective.name, sample) for question, sample in self._plan.asked())
            require_planned(file, ((a.objective, a.sample) for a in known), asked)
            for answer in known:
                self._count(answer)

            def keep(answer: Answer) -> None:
                lines.append(answer.model_dump_json().encode())
                self._count(answer)
                self._show(self.done, self._plan.count)

            left = islice(self._plan.asked(), self.done, None)
            try:
                await work_in_order(left, self._ask, keep, workers)
            except BudgetSpentError as error:
                return str(error)
        return None

    def _count(self, answer: Answer) -> None:
        self.done, self.variants = self.done + 1, self.variants + len(answer.variants)

    async def _ask(self, asked: tuple[ObjectivePrompt, int]) -> Answer:
        """One answer, and its variants. Each sample has its own seed."""
        question, sample = asked
        name, plan = question.objective.name, self._plan
        seed = plan.seed + sample
        sampling = Sampling.model_validate({**plan.sampling, "seed": seed})
        label = f"data/{name}/sample-{sample}"
        request = Request(role=ROLE, label=label, messages=question.messages, sampling=sampling)
        reply = await self._client.complete(request)
        rationale, program = split_reply(reply.text)
        variants = self._vary(program, self._briefs[name], Random(f"{seed}/variants/{label}"))
        return Answer(
            objective=name,
            sample=sample,
            source=plan.model,
            finish=reply.finish,
            rationale=rationale,
            program=program,
            variants=variants,
        )

    def _vary(
        self, program: str, brief: Brief, rng: Random
    ) -> tuple[tuple[dict[str, int], ...], ...]:
        if not self._plan.variants:
            return ()
        report = check(program, brief)
        if report.machine is None or not report.task_valid:
            return ()
        made = make_variants(report.machine, brief, self._plan.variants, rng)
        return tuple(tuple(step.to_json() for step in variant) for variant in made)
