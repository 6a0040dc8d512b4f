"""Keep the answers that are machines which work, are new, and are not in the evaluation."""

import asyncio
import hashlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Literal

from pydantic import BaseModel

from agentflow.env.constants import constants
from agentflow.env.physics.engines import choose_engine
from agentflow.env.pool.pool import OpenPool, RolloutPool
from agentflow.errors import RunError
from agentflow.llm.procedural import ProceduralClient
from agentflow.machine import Brief, Machine
from agentflow.progress import Progress
from agentflow.training.data.card import DataCard, make_card, write_set
from agentflow.training.data.contamination import compare_texts, evaluation_trees
from agentflow.training.data.folder import work_in
from agentflow.training.data.gates import Judge, Judgement, PairCandidate
from agentflow.training.data.generate import (
    ANSWERS,
    COMMAND,
    Answer,
    AnswerPlan,
    ObjectivePrompt,
    describe_changes,
    read_answers,
)
from agentflow.training.data.pairs import Pair, clean_text, make_pair

JUDGED = "judged.jsonl"


class FilterPlan(BaseModel, frozen=True, extra="forbid"):
    """Everything that decides a set."""

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
    show: Progress,
    open_pool: OpenPool = RolloutPool,
) -> DataCard:
    """Write a set of the pairs in a folder of answers that pass all gates, with its card.

    Args:
        folder: From `generate`.
        out: Folder of the set.
        evaluation: Runs and evaluations whose machines must not be in the set.
        engine: Name of the physics engine.
        licence: Of the set; by default ours for the procedural model, else unknown.
        workers: Processes that simulate.
        show: Called with how many machines are judged, of how many.
        open_pool: Opens a pool of these processes.

    Raises:
        RunError: A folder is not what it should be, is in use, or cannot be written.
        ConfigError: A library or the engine is not installed.
        InterruptedRunError: Ctrl-C; the same command continues.
    """
    answer_plan, answers = read_answers(folder)
    candidates = _candidates(list(answers))
    if not candidates:
        raise RunError(f"{folder} holds no answers; record some with {COMMAND}")
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
        judge = Judge(answer_plan, likenesses, trees, chosen.name)
        judged = asyncio.run(judge.judge(candidates, out / JUDGED, workers, open_pool, show))
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


def _candidates(answers: Sequence[Answer]) -> list[PairCandidate]:
    """The machines of all answers, then their variants: those of machines that work are worth a
    simulation."""
    own = [PairCandidate(answer, 0) for answer in answers]
    return own + [PairCandidate(a, n) for a in answers for n in range(1, len(a.variants) + 1)]


def _pairs(
    plan: AnswerPlan, candidates: Sequence[PairCandidate], judged: Sequence[Judgement]
) -> Iterator[Pair]:
    """The pairs of the set, in the order of the answers."""
    questions = {item.objective.name: item for item in plan.questions}
    for candidate, judgement in zip(candidates, judged, strict=True):
        if judgement.dropped is None:
            question = questions[judgement.objective]
            yield _pair(question, candidate, judgement)


def _pair(question: ObjectivePrompt, candidate: PairCandidate, judgement: Judgement) -> Pair:
    answer, brief = candidate.answer, question.objective.task.brief
    rationale, machine = clean_text(answer.rationale), _read(candidate, brief)
    if candidate.variant:
        own = _read(PairCandidate(answer, 0), brief)
        rationale = f"{rationale} {describe_changes(own, machine)}".lstrip()
    return make_pair(
        question.prompt,
        rationale,
        machine,
        None,
        objective=answer.objective,
        score=judgement.score,
        source=candidate.source,
    )


def _read(candidate: PairCandidate, brief: Brief) -> Machine:
    machine = candidate.report(brief).machine
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
