"""The gates that machines pass on their way into a set, in the order of their cost."""

import asyncio
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Literal

from pydantic import BaseModel

from agentflow.diversity.topology import tree_hash
from agentflow.env.pool.pool import AHEAD, OpenPool, Pool
from agentflow.env.tasks.base import Task
from agentflow.files.lines import require_planned
from agentflow.machine import Brief, Machine, Report, check
from agentflow.progress import Progress
from agentflow.search.concurrency import work_in_order
from agentflow.training.data.contamination import Likeness
from agentflow.training.data.folder import open_log
from agentflow.training.data.generate import EDITED, Answer, AnswerPlan
from agentflow.training.objectives.objective import Objective, works

Gate = Literal[
    "objective",
    "original",
    "parse",
    "validity",
    "evaluation",
    "duplicate",
    "simulation",
    "function",
]
GATES: Mapping[Gate, str] = MappingProxyType(
    {
        "objective": "the objective's text is not too near the brief of a level",
        "original": "it is not a variant of a machine that another gate dropped (except as a "
        "duplicate)",
        "parse": "the reply holds a machine",
        "validity": "the machine meets the rules of space and of the task",
        "evaluation": "the machine is in no evaluation and no record of a level",
        "duplicate": "no earlier machine is the same tree of block types",
        "simulation": "the simulation neither timed out nor crashed",
        "function": "the simulated machine does what the objective asks",
    }
)
"""In their order, cheap ones first: what passes each of them."""


class Judgement(BaseModel, frozen=True, extra="forbid"):
    """What the gates said about one machine; a line of `judged.jsonl`."""

    objective: str
    sample: int
    variant: int = 0
    """0 is the machine of the reply, others are its variants."""
    source: str
    dropped: Gate | None = None
    """The gate that did not let it pass; None if it is in the set."""
    why: str = ""
    """Code of the first problem, or names of the function tests that it failed."""
    tree: str = ""
    """Hash of its tree of block types."""
    score: float | None = None


@dataclass(frozen=True)
class PairCandidate:
    """The machine of an answer, or one of its variants."""

    answer: Answer
    variant: int

    @property
    def key(self) -> tuple[str, int, int]:
        return self.answer.objective, self.answer.sample, self.variant

    @property
    def source(self) -> str:
        return self.answer.source + EDITED * bool(self.variant)

    def report(self, brief: Brief) -> Report:
        """The machine, read and checked."""
        if self.variant:
            return check(list(self.answer.variants[self.variant - 1]), brief)
        return check(self.answer.program, brief)


_Screened = tuple[Judgement, Machine | None]
"""A candidate after the gates that need no simulation, and what to simulate unless one drops it."""


class Judge:
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
        """Objective and tree of every candidate whose simulation neither timed out nor crashed."""
        self._turns: defaultdict[tuple[str, str], asyncio.Lock] = defaultdict(asyncio.Lock)
        """Candidates with the same objective and tree are simulated one after the other."""
        self._useless: set[tuple[str, int]] = set()
        """Objective and sample of the answers whose variants are not worth a simulation."""
        self._kept: set[str] = set()
        """Trees in the set."""

    async def judge(
        self,
        candidates: Sequence[PairCandidate],
        log: Path,
        workers: int,
        open_pool: OpenPool,
        show: Progress,
    ) -> list[Judgement]:
        """Judge what the log lacks, and note each judgement there."""
        with open_log(log, Judgement) as (lines, judged):
            known = ((item.objective, item.sample, item.variant) for item in judged)
            require_planned(log, known, (candidate.key for candidate in candidates))
            for judgement in judged:
                self._remember(judgement)
            left = candidates[len(judged) :]

            def keep(judgement: Judgement) -> None:
                settled = self._settle(judgement)
                lines.append(settled.model_dump_json(exclude_defaults=True).encode())
                judged.append(settled)
                show(len(judged), len(candidates))

            async with open_pool(workers) as pool:
                work = partial(self._simulate, pool)
                for variants in (False, True):
                    screened = (self._screen(c) for c in left if bool(c.variant) == variants)
                    await work_in_order(screened, work, keep, AHEAD * workers)
        return judged

    def _screen(self, candidate: PairCandidate) -> _Screened:
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
            return _drop(judgement, "objective", likeness.level), None
        if candidate.variant and (answer.objective, answer.sample) in self._useless:
            return _drop(judgement, "original"), None
        report = candidate.report(self._briefs[answer.objective])
        if report.machine is None:
            return _drop(judgement, "parse", report.problems[0].code), None
        if not report.task_valid:
            return _drop(judgement, "validity", report.problems[0].code), None
        tree = tree_hash(report.machine)
        judgement = judgement.model_copy(update={"tree": tree})
        if tree in self._trees:
            return _drop(judgement, "evaluation"), None
        if tree in self._kept or (answer.objective, tree) in self._seen:
            return _drop(judgement, "duplicate"), None
        return judgement, report.machine

    async def _simulate(self, pool: Pool, screened: _Screened) -> Judgement:
        """Apply the gates that need a simulation; again if that of an equal one failed."""
        judgement, machine = screened
        if machine is None:
            return judgement
        known = judgement.objective, judgement.tree
        async with self._turns[known]:
            if known in self._seen:
                return _drop(judgement, "duplicate")
            tested = await self._test(pool, judgement, machine)
            if tested.dropped != "simulation":
                self._seen.add(known)
            return tested

    async def _test(self, pool: Pool, judgement: Judgement, machine: Machine) -> Judgement:
        """Simulate a machine and see whether it does what its objective asks."""
        rollout = await pool.run(machine, self._tasks[judgement.objective])
        if rollout.score is None:
            return _drop(judgement, "simulation", rollout.status)
        if rollout.status != "ok":
            return _drop(judgement, "function", rollout.status)
        verdict = works(self._objectives[judgement.objective], rollout, machine)
        if not verdict.passed:
            failed = (name for name, finding in verdict.found.items() if not finding.passed)
            return _drop(judgement, "function", ", ".join(failed))
        return judgement.model_copy(update={"score": rollout.score})

    def _settle(self, judgement: Judgement) -> Judgement:
        """The judgement, unless the same tree has come into the set since it was screened."""
        if judgement.tree in self._kept:
            judgement = _drop(judgement, "duplicate").model_copy(update={"score": None})
        self._remember(judgement)
        return judgement

    def _remember(self, judgement: Judgement) -> None:
        if not judgement.variant and judgement.dropped not in (None, "evaluation", "duplicate"):
            self._useless.add((judgement.objective, judgement.sample))
        if judgement.tree and judgement.dropped not in ("evaluation", "duplicate", "simulation"):
            self._seen.add((judgement.objective, judgement.tree))
        if judgement.dropped is None:
            self._kept.add(judgement.tree)


def _task(objective: Objective, engine: str) -> Task:
    task = objective.task
    return replace(task, engine=engine, base=replace(task.base, engine=engine))


def _drop(judgement: Judgement, gate: Gate, why: str = "") -> Judgement:
    return judgement.model_copy(update={"dropped": gate, "why": why})
