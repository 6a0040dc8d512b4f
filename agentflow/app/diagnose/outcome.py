"""The question whether a machine stands, drives or throws; a simulation judges the answers."""

import asyncio
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from importlib.resources import files
from itertools import chain, islice
from math import cos, radians
from random import Random
from typing import Any, ClassVar

import yaml

from agentflow.agents.context import machine_context, task_context
from agentflow.app.diagnose.geometry import draw_design
from agentflow.app.diagnose.question import Diagnostic, Mark, Question
from agentflow.app.diagnose.reading import read_verdicts
from agentflow.env.pool.pool import RolloutPool
from agentflow.env.rollout import Rollout
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.registry import get_task
from agentflow.errors import UsageError
from agentflow.machine import Machine
from agentflow.machine.edits.random import random_edit
from agentflow.metrics.intervals import Rate
from agentflow.training.objectives.handling import Throws
from agentflow.training.objectives.measuring import FunctionTest, Motion
from agentflow.training.objectives.travelling import Moves

EDITS = 3
"""Most random edits of a design: many machines still work, many do not."""
LEAN = 20.0
"""Greatest angle by which a machine that stands leans at t = 0, degrees."""
STAND = "stand"
TESTS: Mapping[str, FunctionTest] = {"drive": Moves(metres=2.0), "throw": Throws(metres=5.0)}
"""What machines do apart from standing."""
ALL = "all"
"""Name of the numbers of all questions."""


class Outcome(Diagnostic):
    """Whether a machine stands, drives or throws."""

    name: ClassVar[str] = "outcome"

    def __init__(self, engine: str, seed: int) -> None:
        self._engine, self._seed = engine, seed

    def questions(self, size: int, seed: int) -> list[Question]:
        """Designs of `outcome.yaml`: for every verb as many that do it as not, in random order."""
        rng = Random(f"diagnose/fate/{seed}")
        cells = [
            [(verb, name) for name in rng.sample(names, len(names))]
            for verb, lists in _known_designs().items()
            for names in lists.values()
        ]
        if size > (most := sum(map(len, cells))):
            raise UsageError(f"outcome has {most} questions, not {size}: lower --questions")
        chosen = list(islice(chain.from_iterable(zip(*cells, strict=True)), size))
        rng.shuffle(chosen)
        return [
            Question(f"outcome/{number}", draw_edited(name), None, [_level(name), verb])
            for number, (verb, name) in enumerate(chosen)
        ]

    def variables(self, question: Question) -> Mapping[str, object]:
        brief, (_, verb) = self._task(question).brief, question.about
        return {
            **task_context(brief),
            **machine_context(question.machine, spatial=True, brief=brief),
            "verb": verb,
            "rule": _rule(verb),
        }

    def read(self, text: str, question: Question) -> dict[str, bool] | None:
        """Yes or no for what was asked."""
        _, verb = question.about
        said = read_verdicts(text)
        return {verb: said[verb]} if verb in said else None

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
        """Shares of right answers, of yes in the simulations, and of yes in the answers."""
        judged = [mark for mark in marks if mark.truth is not None]
        verbs = {verb: [m for m in judged if verb in m.truth] for verb in (STAND, *TESTS)}
        return {
            "faults": len(marks) - len(judged),
            **{name: _count(own) for name, own in {**verbs, ALL: judged}.items()},
        }

    def _task(self, question: Question) -> Task:
        level, _ = question.about
        return get_task(level, {}, self._engine)


@cache
def _known_designs() -> Mapping[str, Mapping[bool, list[str]]]:
    """Verb -> whether they do it -> names of designs."""
    text = files("agentflow.app.diagnose").joinpath("outcome.yaml").read_text("utf-8")
    known: Mapping[str, Mapping[bool, list[str]]] = yaml.safe_load(text)
    return known


def draw_edited(name: str) -> Machine:
    """A design after up to `EDITS` random edits that are legal at its level.

    Args:
        name: Its level and a number, such as "throwing-17"; the name decides the machine.
    """
    rng, level = Random(f"diagnose/fate/{name}"), _level(name)
    machine, brief = draw_design(rng, level), get_task(level).brief
    for _ in range(rng.randint(0, EDITS)):
        machine = random_edit(machine, rng, brief)
    return machine


def _level(name: str) -> str:
    return name.partition("-")[0]


def _rule(verb: str) -> str:
    """What must happen, to follow "yes if"."""
    if verb == STAND:
        return (
            f"at t = 0, after it has settled with its motors off, its Starting Block leans by at "
            f"most {LEAN:g} degrees from how it was built"
        )
    return TESTS[verb].phrase()


def _truth(rollout: Rollout, question: Question, window: float) -> dict[str, bool] | None:
    """What the machine did; None if the simulation timed out or crashed, which says nothing."""
    if rollout.status in ("timeout", "crashed"):
        return None
    _, verb = question.about
    if rollout.status != "ok" or rollout.trace is None:
        return {verb: False}
    return {verb: _happens(verb, Motion(question.machine, rollout, rollout.trace, window))}


def _happens(verb: str, motion: Motion) -> bool:
    if verb == STAND:
        x, _, z, _ = motion.trace.rotation[0, 0]
        return bool(1 - 2 * (x * x + z * z) >= cos(radians(LEAN)))
    return all(finding.passed for _, finding in TESTS[verb].measure(motion))


def _count(marks: Sequence[Mark]) -> dict[str, Any]:
    """The numbers of some questions; a missing answer is a wrong one."""
    true = sum(True in mark.truth.values() for mark in marks)
    said = sum(True in (mark.answer or {}).values() for mark in marks)
    right = sum(mark.answer == mark.truth for mark in marks)
    rates = {"right": right, "yes": true, "said_yes": said}
    return {name: Rate(count, len(marks)).to_json() for name, count in rates.items()}
