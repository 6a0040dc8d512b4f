"""The questions whether a machine stands, drives and throws; a simulation judges the answers."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import cycle, islice
from math import cos, radians
from random import Random
from typing import Any, ClassVar

from agentflow.agents.context import machine_context, task_context
from agentflow.app.diagnose.machines import LEVELS, draw_design
from agentflow.app.diagnose.question import Diagnostic, Mark, Question
from agentflow.app.diagnose.reading import read_verdicts
from agentflow.app.diagnose.scores import Detection, rate_json
from agentflow.env.pool.pool import RolloutPool
from agentflow.env.rollout import Rollout
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.registry import get_task
from agentflow.machine import Machine
from agentflow.machine.edits.random import random_edit
from agentflow.metrics.validity import Rate
from agentflow.training.objectives.finding import FunctionTest
from agentflow.training.objectives.handling import Throws
from agentflow.training.objectives.motion import Motion
from agentflow.training.objectives.travelling import Moves

EDITS = 3
"""Most random edits of a design: many machines still work, many do not."""
LEAN = 20.0
"""Greatest angle by which a machine that stands leans at t = 0, degrees."""
STAND = "stand"
TESTS: Mapping[str, FunctionTest] = {"drive": Moves(metres=2.0), "throw": Throws(metres=5.0)}
"""What machines of the two levels do apart from standing."""
ASKED: Mapping[str, tuple[str, ...]] = {
    "movement": (STAND, "drive"),
    "throwing": (STAND, "throw"),
}
"""Level -> what is asked of its machines."""


class Fate(Diagnostic):
    """Whether a machine stands, drives, throws."""

    name: ClassVar[str] = "fate"

    def __init__(self, engine: str, seed: int) -> None:
        self._engine, self._seed = engine, seed

    def questions(self, size: int, seed: int) -> list[Question]:
        """`size` designs, for each level in turn, with up to `EDITS` random legal edits."""
        rng = Random(f"diagnose/fate/{seed}")
        return [
            Question(f"fate/{number}", _draw(rng, level), None, level)
            for number, level in enumerate(islice(cycle(LEVELS), size))
        ]

    def variables(self, question: Question) -> Mapping[str, object]:
        brief = self._task(question).brief
        return {
            **task_context(brief),
            **machine_context(question.machine, spatial=True, brief=brief),
            "asked": {name: _rule(name) for name in ASKED[question.about]},
        }

    def read(self, text: str, question: Question) -> dict[str, bool] | None:
        """Yes or no for what was asked."""
        said = read_verdicts(text)
        return {name: said[name] for name in ASKED[question.about] if name in said} or None

    async def judge(self, questions: Sequence[Question], workers: int) -> list[Question]:
        """Simulate every machine."""
        async with RolloutPool(min(workers, len(questions))) as pool:
            runs = (pool.run(q.machine, self._task(q), seed=self._seed) for q in questions)
            rollouts = await asyncio.gather(*runs)
        return [
            replace(question, truth=_truth(rollout, question, self._task(question).window))
            for question, rollout in zip(questions, rollouts, strict=True)
        ]

    def score(self, marks: Sequence[Mark]) -> dict[str, Any]:
        """Per verb, the share of right answers, of yes in the simulations, and the detection."""
        judged = [mark for mark in marks if mark.truth is not None]
        verbs = {verb: _count(judged, verb) for verb in (STAND, *TESTS)}
        return {"faults": len(marks) - len(judged), **verbs}

    def _task(self, question: Question) -> Task:
        return get_task(question.about, {}, self._engine)


def _draw(rng: Random, level: str) -> Machine:
    """A design after up to `EDITS` random edits that are legal at its level."""
    machine, brief = draw_design(rng, level), get_task(level).brief
    for _ in range(rng.randint(0, EDITS)):
        machine = random_edit(machine, rng, brief)
    return machine


def _rule(name: str) -> str:
    """What must happen, to follow "yes if"."""
    if name == STAND:
        return (
            f"at t = 0, after it has settled with its motors off, its Starting Block leans by at "
            f"most {LEAN:g} degrees from how it was built"
        )
    return TESTS[name].phrase


def _truth(rollout: Rollout, question: Question, window: float) -> dict[str, bool] | None:
    """What the machine did; None if the simulation timed out or crashed, which says nothing."""
    if rollout.status in ("timeout", "crashed"):
        return None
    if rollout.status != "ok" or rollout.trace is None:
        return dict.fromkeys(ASKED[question.about], False)
    motion = Motion(question.machine, rollout, rollout.trace, window)
    return {name: _happens(name, motion) for name in ASKED[question.about]}


def _happens(name: str, motion: Motion) -> bool:
    if name == STAND:
        x, _, z, _ = motion.trace.rotation[0, 0]
        return bool(1 - 2 * (x * x + z * z) >= cos(radians(LEAN)))
    return all(finding.passed for _, finding in TESTS[name].measure(motion))


def _count(marks: Sequence[Mark], verb: str) -> dict[str, Any]:
    """The numbers of one verb; a missing answer is a wrong one."""
    pairs = [
        (mark.truth[verb], (mark.answer or {}).get(verb)) for mark in marks if verb in mark.truth
    ]
    yes = sum(true for true, _ in pairs)
    detection = Detection(
        sum(true and said is True for true, said in pairs),
        sum(said is True for _, said in pairs),
        yes,
    )
    return {
        "right": rate_json(Rate(sum(true == said for true, said in pairs), len(pairs))),
        "yes": rate_json(Rate(yes, len(pairs))),
        "recall": detection.recall.value,
        "precision": detection.precision.value,
        "f1": detection.f1,
    }
