"""Asks a model the questions of a diagnostic, marks its answers, writes the record."""

import asyncio
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from agentflow.agents.designer import Designer
from agentflow.app.diagnose.geometry import Facing, Overlap
from agentflow.app.diagnose.outcome import Outcome
from agentflow.app.diagnose.question import (
    DOCUMENT,
    Diagnosis,
    Diagnostic,
    Mark,
    Question,
    digest_of,
)
from agentflow.config.run import DesignConfig
from agentflow.env.physics.engines import physics_conditions
from agentflow.errors import ConfigError, UnknownNameError, UsageError
from agentflow.files.folders import hold_folder
from agentflow.llm.messages import Client, Message, Request
from agentflow.models.choices import CALLS, choose_models, continuable, recorded_models
from agentflow.models.completion import find_unused_setting
from agentflow.progress import Progress, counter, silent
from agentflow.prompts.render import PromptSet
from agentflow.runs import Notify
from agentflow.search.concurrency import work_in_order

ROLE = Designer.name
QUESTIONS = "_questions"
AT_ONCE = 32
"""Most questions that wait for their answers at a time."""
DIAGNOSTICS: dict[str, Callable[[DesignConfig], Diagnostic]] = {
    Overlap.name: lambda _config: Overlap(),
    Facing.name: lambda _config: Facing(),
    Outcome.name: lambda config: Outcome(config.engine, config.seed),
}


def diagnose(
    name: str,
    config: DesignConfig,
    size: int,
    out: Path,
    *,
    client: Client | None = None,
    notify: Notify = lambda _line: None,
    say: Progress = silent,
) -> Diagnosis:
    """Ask the configured model; continue an interrupted diagnosis.

    Args:
        name: The diagnostic: a key of `DIAGNOSTICS`.
        config: Model, sampling, seed, prompts, engine and workers; the rest is not used.
        size: Total number of overlapping pairs for `overlap`, questions for the others.
        out: Directory of the diagnosis; created if missing.
        client: Answers in place of the configured model.
        notify: Receives remarks for the user.
        say: Receives progress.

    Returns:
        What is written to diagnosis.json.

    Raises:
        UsageError: A value is wrong, or the directory holds something else.
        EndpointError: The model cannot be used; what it has answered is kept.
        InterruptedRunError: Ctrl-C.
    """
    diagnostic = _open_diagnostic(name, config, size, client)
    questions = diagnostic.questions(size, config.seed)
    about = _describe(name, config, size, client, questions)
    prompts, tick = PromptSet(config.prompts), counter(say, len(questions))

    async def ask(asked: Client, question: Question) -> str:
        system, user = prompts.render(f"{QUESTIONS}/{name}", diagnostic.variables(question))
        request = Request(
            role="diagnose",
            label=question.label,
            messages=(Message(role="system", text=system), Message(role="user", text=user)),
            sampling=about.sampling,
        )
        reply = await asked.complete(request)
        tick()
        return reply.text

    async def complete() -> Diagnosis:
        texts: list[str] = []
        async with recorded_models(config, out, notify, client) as models:
            work = partial(ask, models.clients[ROLE])
            await work_in_order(questions, work, texts.append, AT_ONCE)
        judged = await diagnostic.judge(questions, config.workers)
        marks = tuple(
            Mark(
                label=question.label,
                machine=question.machine.to_json(),
                truth=question.truth,
                answer=diagnostic.read(text, question),
            )
            for question, text in zip(judged, texts, strict=True)
        )
        unreadable = sum(mark.answer is None for mark in marks)
        results = {"questions": len(marks), "unreadable": unreadable, **diagnostic.score(marks)}
        finished = about.model_copy(update={"answers": marks, "results": results})
        return Diagnosis.model_validate_json(finished.model_dump_json())  # as it will be read again

    with continuable(), hold_folder(out):
        found = DOCUMENT.begin(out, about, (CALLS,))
        if found.results is None:
            found = asyncio.run(complete())
            DOCUMENT.write(out, found)
        return found


def _open_diagnostic(
    name: str, config: DesignConfig, size: int, client: Client | None
) -> Diagnostic:
    """The diagnostic, with what was asked for checked."""
    if name not in DIAGNOSTICS:
        raise UnknownNameError("diagnostic", name, DIAGNOSTICS)
    if size < 1:
        raise UsageError(f"a diagnosis needs at least one question, not {size}")
    if key := find_unused_setting(config, ("knobs",)):
        raise UsageError(
            f"a diagnosis has no {key}: it asks questions about machines; set only keys of model, "
            "prompts and engine"
        )
    if client is None and choose_models(config.model)[ROLE].procedural:
        raise ConfigError(
            "the procedural model answers no questions about machines: name a language model with "
            "--model (model.name, AGENTFLOW_MODEL)"
        )
    return DIAGNOSTICS[name](config)


def _describe(
    name: str, config: DesignConfig, size: int, client: Client | None, questions: Sequence[Question]
) -> Diagnosis:
    """Everything that decides the results."""
    choice = choose_models(config.model)[ROLE]
    prompts = PromptSet(config.prompts)
    return Diagnosis(
        diagnostic=name,
        model=choice.display_name if client is None else client.name,
        seed=config.seed,
        size=size,
        asked=digest_of(questions),
        sampling=choice.sampling,
        prompts=f"{config.prompts} {prompts.digest_for((QUESTIONS,))}",
        conditions=physics_conditions(config.engine),
    )
