"""Keep the answers that are machines which work, are new, and are not in the evaluation."""

from __future__ import annotations

import asyncio
import hashlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict

from agentflow.env.constants import constants
from agentflow.env.physics.engines import choose_engine
from agentflow.env.pool.pool import RolloutPool
from agentflow.env.tasks.base import Task
from agentflow.files import LineFile
from agentflow.llm.procedural import ProceduralClient
from agentflow.machine import Brief, Machine, Report, check
from agentflow.training.data.answers import (
    ANSWERS,
    COMMAND,
    Answer,
    AnswerPlan,
    Question,
    read_answers,
)
from agentflow.training.data.card import Card, make_card
from agentflow.training.data.contamination import (
    Likeness,
    compare_texts,
    evaluation_trees,
    tree_hash,
)
from agentflow.training.data.folder import map_in_order, read_lines, work_in
from agentflow.training.data.gates import Gate, Judgement
from agentflow.training.data.pairs import Pair, clean_text, make_messages, make_reply
from agentflow.training.data.variants import EDITED, describe_changes
from agentflow.training.data.writing import write_set
from agentflow.training.objectives import Objective, works

JUDGED = "judged.jsonl"
AHEAD = 8
"""Simulations begun for each worker, so that a slow one does not keep the others waiting."""


class FilterPlan(BaseModel):
    """Everything that decides a set."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: Literal["set"] = "set"
    format: Literal[1] = 1
    answers: str
    """Hash of the answers and of their plan."""
    engine: str
    """Physics engine, with its version."""
    constants: str
    """Hash of the physical constants."""
    evaluation: str
    """Hash of the machines that are used for evaluation."""
    licence: str


def filter_answers(
    folder: Path,
    out: Path,
    *,
    evaluation: Sequence[Path],
    engine: str,
    licence: str | None,
    workers: int,
    show: Callable[[int, int], None],
) -> Card:
    """Write a set of the pairs in a folder of answers that pass all gates, with its card.

    Args:
        folder: From `generate`.
        out: Folder of the set.
        evaluation: Runs whose machines must not be in the set.
        engine: Name of the physics engine.
        licence: Of the set; by default ours for the procedural model, else unknown.
        workers: Processes that simulate.
        show: Is told how many machines are judged, of how many.

    Raises:
        RunError: A folder is not what it should be, is in use, or cannot be written.
        ConfigError: A library or the engine is not installed.
        InterruptedRunError: Ctrl-C; the same command continues.
    """
    answer_plan, answers = read_answers(folder)
    candidates = _candidates(list(answers))
    trees = evaluation_trees(evaluation)
    chosen = choose_engine(engine)
    plan = FilterPlan(
        answers=_hash_of((folder / ANSWERS).read_bytes(), answer_plan.model_dump_json().encode()),
        engine=str(chosen.identity),
        constants=constants().digest,
        evaluation=_hash_of("".join(sorted(trees)).encode()),
        licence=licence or default_licence(answer_plan.model),
    )
    texts = {item.objective.name: item.objective.text for item in answer_plan.questions}
    likenesses = compare_texts(texts)
    with work_in(out, plan, JUDGED):
        judge = _Judge(answer_plan, likenesses, trees, chosen.name)
        judged = asyncio.run(judge.judge(candidates, out / JUDGED, workers, show))
        pairs = list(_pairs(answer_plan, candidates, judged))
        card = make_card(
            pairs,
            judged,
            {item.objective.name: item.objective.kind for item in answer_plan.questions},
            model=answer_plan.model,
            made_with=COMMAND,
            licence=plan.licence,
            engine=plan.engine,
            planned=answer_plan.count,
            seed=answer_plan.seed,
            likenesses=likenesses,
        )
        write_set(out, pairs, card)
        return card


@dataclass(frozen=True)
class _Candidate:
    """The machine of an answer, or one of its variants."""

    answer: Answer
    variant: int

    @property
    def source(self) -> str:
        return self.answer.source + EDITED * bool(self.variant)


def _candidates(answers: Sequence[Answer]) -> list[_Candidate]:
    """The machines of all answers, then their variants: those of machines that work are worth a
    simulation."""
    own = [_Candidate(answer, 0) for answer in answers]
    return own + [_Candidate(a, n) for a in answers for n in range(1, len(a.variants) + 1)]


@dataclass(frozen=True)
class _Screened:
    """A candidate after the gates that need no simulation."""

    judgement: Judgement
    machine: Machine | None
    """To simulate; None if a gate dropped it."""


class _Judge:
    """Applies the gates to candidates in their order; the outcome does not depend on timing."""

    def __init__(
        self,
        plan: AnswerPlan,
        likenesses: Mapping[str, Likeness],
        trees: frozenset[str],
        engine: str,
    ) -> None:
        self._objectives = {item.objective.name: item.objective for item in plan.questions}
        self._tasks = {name: _task(item, engine) for name, item in self._objectives.items()}
        self._briefs = {name: task.brief for name, task in self._tasks.items()}
        self._likenesses, self._trees = likenesses, trees
        self._seen: set[tuple[str, str]] = set()
        """Objective and tree of every candidate that came as far as its simulation."""
        self._useless: set[tuple[str, int]] = set()
        """Objective and sample of the answers whose variants are not worth a simulation."""
        self._kept: set[str] = set()
        """Trees in the set."""

    async def judge(
        self,
        candidates: Sequence[_Candidate],
        log: Path,
        workers: int,
        show: Callable[[int, int], None],
    ) -> list[Judgement]:
        """Judge what the log lacks, and note each judgement there."""
        lines = LineFile(log)
        judged = list(read_lines(log, Judgement))
        for judgement in judged:
            self._remember(judgement)
        left = candidates[len(judged) :]
        try:
            async with RolloutPool(workers) as pool:
                work = partial(self._simulate, pool)
                for variants in (False, True):
                    screened = (self._screen(c) for c in left if bool(c.variant) == variants)
                    async for judgement in map_in_order(screened, work, AHEAD * workers):
                        settled = self._settle(judgement)
                        lines.append(settled.model_dump_json(exclude_defaults=True).encode())
                        judged.append(settled)
                        show(len(judged), len(candidates))
        finally:
            lines.close()
        return judged

    def _screen(self, candidate: _Candidate) -> _Screened:
        """Apply the gates that need no simulation."""
        answer = candidate.answer
        judgement = Judgement(
            objective=answer.objective,
            sample=answer.sample,
            variant=candidate.variant,
            source=candidate.source,
        )
        likeness = self._likenesses[answer.objective]
        if likeness.contaminated:
            return _drop(judgement, "objective", likeness.level)
        if candidate.variant and (answer.objective, answer.sample) in self._useless:
            return _drop(judgement, "original")
        report = _report(candidate, self._briefs[answer.objective])
        if report.machine is None:
            return _drop(judgement, "parse", report.problems[0].code)
        if not report.task_valid:
            return _drop(judgement, "validity", report.problems[0].code)
        tree = tree_hash(report.machine)
        judgement = judgement.model_copy(update={"tree": tree})
        if tree in self._trees:
            return _drop(judgement, "evaluation")
        if tree in self._kept or (answer.objective, tree) in self._seen:
            return _drop(judgement, "duplicate")
        self._seen.add((answer.objective, tree))
        return _Screened(judgement, report.machine)

    async def _simulate(self, pool: RolloutPool, screened: _Screened) -> Judgement:
        """Apply the gates that need a simulation."""
        judgement, machine = screened.judgement, screened.machine
        if machine is None:
            return judgement
        rollout = await pool.run(machine, self._tasks[judgement.objective])
        if rollout.score is None:
            return _drop(judgement, "simulation", rollout.status).judgement
        if rollout.status != "ok":
            return _drop(judgement, "function", rollout.status).judgement
        verdict = works(self._objectives[judgement.objective], rollout, machine)
        if not verdict.passed:
            failed = (name for name, finding in verdict.found.items() if not finding.passed)
            return _drop(judgement, "function", ", ".join(failed)).judgement
        return judgement.model_copy(update={"score": rollout.score})

    def _settle(self, judgement: Judgement) -> Judgement:
        """The judgement, unless the same tree has come into the set since it was screened."""
        if judgement.tree in self._kept:
            judgement = judgement.model_copy(
                update={"dropped": "duplicate", "why": "", "score": None}
            )
        self._remember(judgement)
        return judgement

    def _remember(self, judgement: Judgement) -> None:
        if not judgement.variant and judgement.dropped not in (None, "evaluation", "duplicate"):
            self._useless.add((judgement.objective, judgement.sample))
        if judgement.tree and judgement.dropped not in ("evaluation", "duplicate"):
            self._seen.add((judgement.objective, judgement.tree))
        if judgement.dropped is None:
            self._kept.add(judgement.tree)


def _task(objective: Objective, engine: str) -> Task:
    task = objective.task
    return replace(task, engine=engine, base=replace(task.base, engine=engine))


def _drop(judgement: Judgement, gate: Gate, why: str = "") -> _Screened:
    return _Screened(judgement.model_copy(update={"dropped": gate, "why": why}), None)


def _report(candidate: _Candidate, brief: Brief) -> Report:
    """The machine of a candidate, read and checked."""
    if candidate.variant:
        return check(list(candidate.answer.variants[candidate.variant - 1]), brief)
    return check(candidate.answer.program, brief)


def _pairs(
    plan: AnswerPlan, candidates: Sequence[_Candidate], judged: Sequence[Judgement]
) -> Iterator[Pair]:
    """The pairs of the set, in the order of the answers."""
    questions = {item.objective.name: item for item in plan.questions}
    for candidate, judgement in zip(candidates, judged, strict=True):
        if judgement.dropped is None:
            question = questions[judgement.objective]
            yield _pair(question, candidate, judgement)


def _pair(question: Question, candidate: _Candidate, judgement: Judgement) -> Pair:
    answer, brief = candidate.answer, question.objective.task.brief
    rationale, machine = clean_text(answer.rationale), _read(candidate, brief)
    if candidate.variant:
        own = _read(_Candidate(answer, 0), brief)
        rationale = f"{rationale} {describe_changes(own, machine)}".lstrip()
    return Pair(
        messages=make_messages(question.prompt, make_reply(rationale, machine)),
        machine=tuple(machine.to_json()),
        objective=answer.objective,
        rationale=rationale,
        score=judgement.score,
        source=candidate.source,
    )


def _read(candidate: _Candidate, brief: Brief) -> Machine:
    machine = _report(candidate, brief).machine
    assert machine is not None, "it passed its gates"
    return machine


def default_licence(model: str) -> str:
    """The licence of texts that a model wrote, as far as we know it."""
    return "MIT" if model == ProceduralClient.name else "not stated; see the terms of the model"


def _hash_of(*content: bytes) -> str:
    digest = hashlib.sha256()
    for part in content:
        digest.update(part)
    return digest.hexdigest()[:16]
