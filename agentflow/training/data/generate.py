"""Asks a model for machines for design objectives: its answers, recorded, and variants of their
machines.

Whether a variant still works is for the function test to say, as with the answer itself.
"""

import asyncio
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path
from random import Random
from typing import Any, Literal

from pydantic import BaseModel

from agentflow.agents.base import chat_prompt
from agentflow.agents.designer import FENCE, MAX_RATIONALE, Designer, extract_rationale
from agentflow.config.run import DesignConfig
from agentflow.errors import BudgetSpentError, UsageError
from agentflow.files.lines import require_planned
from agentflow.llm.messages import Client, Message, Request, Sampling, Text
from agentflow.machine import Brief, Machine, check, library
from agentflow.machine.edits.random import random_edit
from agentflow.models.choices import choose_models, recorded_models
from agentflow.progress import Progress
from agentflow.runs import Notify
from agentflow.search.concurrency import work_in_order
from agentflow.training.data.folder import open_log, read_log, read_plan, work_in
from agentflow.training.data.pairs import ChatMessage, make_prompt
from agentflow.training.objectives.objective import Objective

MOST_EDITS = 2
"""A variant differs from its machine by 1 or 2 edits: with up to 3, half of them stop working."""
EDITED = ", edited at random"
"""Follows the name of the model in the source of a variant."""


def make_variants(machine: Machine, brief: Brief, share: float, rng: Random) -> list[Machine]:
    """Variants of a valid machine, `share` on average."""
    count = int(share) + (rng.random() < share % 1)
    return [_edit(machine, brief, rng) for _ in range(count)]


def _edit(machine: Machine, brief: Brief, rng: Random) -> Machine:
    for _ in range(rng.randint(1, MOST_EDITS)):
        try:
            machine = random_edit(machine, rng, brief)
        except UsageError:  # no legal edit
            break
    return machine


def describe_changes(machine: Machine, variant: Machine) -> str:
    """Which blocks a variant has more or fewer of, as a sentence that continues a rationale."""
    before, after = (Counter(step.type for step in item) for item in (machine, variant))
    parts = [f"{n} more {library()[kind].name}" for kind, n in sorted((after - before).items())]
    parts += [f"{n} fewer {library()[kind].name}" for kind, n in sorted((before - after).items())]
    return f"Changed: {', '.join(parts) or 'where blocks are attached'}."


ANSWERS = "answers.jsonl"
COMMAND = "agentflow data generate"


class ObjectivePrompt(BaseModel, frozen=True, extra="forbid"):
    """An objective, and the prompt that asks for a machine that meets it."""

    objective: Objective
    prompt: tuple[ChatMessage, ...]

    @property
    def messages(self) -> tuple[Message, ...]:
        """The prompt for a client."""
        return tuple(Message(role=item.role, text=item.content) for item in self.prompt)


class AnswerPlan(BaseModel, frozen=True, extra="forbid"):
    """Everything that decides the answers in a folder, apart from the model's own chance."""

    kind: Literal["answers"] = "answers"
    format: Literal[1] = 1
    model: str
    """Name of the model in results."""
    sampling: Mapping[str, Any]
    seed: int
    samples: int
    """Answers to each objective."""
    limit: int | None
    """Maximum number of answers; they are spread over the objectives."""
    variants: float
    """Machines made by random edits for each answer with a valid machine, on average."""
    questions: tuple[ObjectivePrompt, ...]

    @property
    def count(self) -> int:
        """Number of answers."""
        whole = self.samples * len(self.questions)
        return whole if self.limit is None else min(whole, self.limit)

    def asked(self) -> Iterator[tuple[ObjectivePrompt, int]]:
        """Question and number of the sample of each answer, in their order in the file."""
        pairs = ((question, n) for n in range(self.samples) for question in self.questions)
        return islice(pairs, self.count)


class Answer(BaseModel, frozen=True, extra="forbid"):
    """One answer: rationale and program apart, and machines made from it by random edits."""

    objective: str
    sample: int
    source: str
    """Name of the model."""
    finish: str
    """Why the reply ended; see `llm.messages.Finish`."""
    rationale: Text
    program: Text
    """As the model wrote it."""
    variants: tuple[tuple[Mapping[str, int], ...], ...] = ()
    """Construction trees."""


def split_reply(text: str) -> tuple[str, str]:
    """The rationale of a reply, and its program: the code fences, or else all from the first list.

    Never raises. The rationale is cut to `MAX_RATIONALE` characters.
    """
    if fences := FENCE.findall(text):
        return extract_rationale(text), "\n".join(fences)
    start = text.find("[")
    if start < 0:
        return text.strip()[:MAX_RATIONALE], ""
    return text[:start].strip()[:MAX_RATIONALE], text[start:]


def read_answers(folder: Path) -> tuple[AnswerPlan, Iterator[Answer]]:
    """The plan of a folder of answers, and its answers, one at a time.

    Raises:
        RunError: It is not such a folder, or (while iterating) a line is damaged.
    """
    plan = read_plan(folder, AnswerPlan, COMMAND)
    return plan, read_log(folder / ANSWERS, Answer)


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

    async def carry_out() -> dict[str, Any]:
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

    with work_in(out, plan, ANSWERS):
        return asyncio.run(carry_out())


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
