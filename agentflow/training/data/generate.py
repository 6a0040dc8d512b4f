"""Ask a model for machines for design objectives, and record its answers."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from random import Random
from typing import Any

from agentflow.app.design.models import charge_budget, choose_models, open_models
from agentflow.app.prompts import render_prompt
from agentflow.config.run import DesignConfig
from agentflow.errors import BudgetSpentError, EndpointError, UsageError
from agentflow.llm.client import Client
from agentflow.llm.messages import Request, Sampling
from agentflow.llm.wrappers.budget import Budget
from agentflow.llm.wrappers.tape import Tape
from agentflow.machine import Brief, check
from agentflow.runs import Notify
from agentflow.training.data.answers import ANSWERS, Answer, AnswerPlan, Question, split_reply
from agentflow.training.data.folder import (
    AGAIN,
    map_in_order,
    open_log,
    require_same,
    work_in,
)
from agentflow.training.data.pairs import make_prompt
from agentflow.training.data.variants import make_variants
from agentflow.training.objectives import Objective

CALLS = "calls.jsonl"
ROLE = "designer"
USED = frozenset({"model", "prompts", "seed"})
"""Keys of a configuration that decide answers; an objective has everything else."""

Progress = Callable[[int, int], None]
"""Is told how many are done, of how many."""


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
        limit: Most answers in all.
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


def _ask_for(objective: Objective, prompts: str) -> Question:
    found = render_prompt(prompts, ROLE, objective.task.brief)
    prompt = make_prompt([{"role": name, "content": found[name]} for name in ("system", "user")])
    return Question(objective=objective, prompt=prompt)


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
    with work_in(out, plan, ANSWERS), Tape(out / CALLS, notify) as tape:
        budget = charge_budget(config.model, tape)
        work = _Work(plan, config, out, workers, show)
        stopped = asyncio.run(work.carry_out(tape, budget, notify))
        return {
            "out": str(out),
            "model": plan.model,
            "answers": work.done,
            "planned": plan.count,
            "variants": work.variants,
            "calls": budget.calls,
            "tokens": budget.usage.total,
            "cost": None if budget.cost is None else round(budget.cost, 6),
            "stopped": stopped,
        }


class _Work:
    """The answers of one folder."""

    def __init__(
        self, plan: AnswerPlan, config: DesignConfig, out: Path, workers: int, show: Progress
    ) -> None:
        self._plan, self._config, self._workers, self._show = plan, config, workers, show
        self._file = out / ANSWERS
        self.done = self.variants = 0
        self._briefs = {item.objective.name: item.objective.task.brief for item in plan.questions}

    async def carry_out(self, tape: Tape, budget: Budget, notify: Notify) -> str | None:
        """Record the answers that are missing; why it stopped before the end, or None."""
        with open_log(self._file, Answer) as (lines, known):
            asked = ((question.objective.name, sample) for question, sample in self._plan.asked())
            require_same(self._file, ((a.objective, a.sample) for a in known), asked)
            for answer in known:
                self._count(answer)
            models = open_models(self._config, tape, budget, notify)
            asker = _Asker(self._plan, models.clients[ROLE], self._briefs)
            left = islice(self._plan.asked(), self.done, None)
            try:
                async for answer in map_in_order(left, asker.ask, self._workers):
                    lines.append(answer.model_dump_json().encode())
                    self._count(answer)
                    self._show(self.done, self._plan.count)
            except BudgetSpentError as error:
                return str(error)
            except EndpointError as error:
                raise type(error)(f"{error}; {AGAIN}") from error
            finally:
                await models.aclose()
        return None

    def _count(self, answer: Answer) -> None:
        self.done, self.variants = self.done + 1, self.variants + len(answer.variants)


@dataclass(frozen=True)
class _Asker:
    plan: AnswerPlan
    client: Client
    briefs: dict[str, Brief]

    async def ask(self, asked: tuple[Question, int]) -> Answer:
        """One answer, and its variants. Each sample has its own seed."""
        question, sample = asked
        name, plan = question.objective.name, self.plan
        seed = plan.seed + sample
        sampling = Sampling.model_validate({**plan.sampling, "seed": seed})
        label = f"data/{name}/sample-{sample}"
        request = Request(role=ROLE, label=label, messages=question.messages, sampling=sampling)
        reply = await self.client.complete(request)
        rationale, program = split_reply(reply.text)
        variants = self._vary(program, self.briefs[name], Random(f"{seed}/variants/{label}"))
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
        if not self.plan.variants:
            return ()
        report = check(program, brief)
        if report.machine is None or not report.task_valid:
            return ()
        made = make_variants(report.machine, brief, self.plan.variants, rng)
        return tuple(tuple(step.to_json() for step in variant) for variant in made)
