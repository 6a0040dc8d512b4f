"""How long feedback can get: every level, twenty blocks that break, tumble and stall, no mercy."""

from __future__ import annotations

import random
import re
from dataclasses import replace

import numpy as np
import pytest

from agentflow.env.feedback.stalls import stalled_motors
from agentflow.env.feedback.text import MAX_SAMPLES
from agentflow.env.rollout import Broken, Feedback, Flags, Rollout, Trace
from agentflow.env.scene import Body
from agentflow.env.simulation.trials import combine_trials
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.registry import get_task, task_names
from agentflow.machine.blocks.library import GRABBER, library
from agentflow.machine.tree import ROOT, Machine, Step
from tests.env.fakes import FakeWorld, make_rollout, make_trace

LIMIT = 1190
"""Tokens: the limit of 1,200, less the error of the count."""
BLOCKS = 20
LONGEST = ("movement/5", "throwing/4", "delivery/5", "jumping", "lifting", "flying/5", "gearing")
"""The level of each family whose text is the longest; picking has 131 samples to thin as well."""
PIECES = re.compile(r"[^\r\n\dA-Za-z]?[A-Za-z]+|\d{1,3}| ?[^\s\dA-Za-z]+[\r\n]*|\s*[\r\n]|\s+")
"""Into what the cl100k_base tokenizer cuts plain English before it merges."""


def tokens(text: str) -> int:
    """Within 3 % of what cl100k_base makes of feedback: a word of over six letters counts twice."""
    return sum(1 + (len(piece) > 7 and piece.strip().isalpha()) for piece in PIECES.findall(text))


class Turmoil(FakeWorld):
    """Everything is somewhere else at every look, and touches something else."""

    def __init__(self, chance: random.Random, scene: list[str]) -> None:
        super().__init__()
        self._chance, self._scene = chance, scene

    def centre(self, body: Body) -> tuple[float, float, float]:  # noqa: ARG002
        chance = self._chance
        return chance.uniform(-20, 20), chance.uniform(1, 30), chance.uniform(-100, 100)

    def touching(self, body: Body) -> frozenset[Body]:  # noqa: ARG002
        chance = self._chance
        touched: list[Body] = [chance.choice(self._scene), chance.randrange(10, BLOCKS)]
        return frozenset(touched[chance.randrange(2) : chance.randrange(3)])


def crowd(task: Task) -> list[Machine]:
    """Machines of twenty blocks of which the text has most to say."""
    brief = task.brief
    long = max(brief.blocks, key=lambda kind: len(library()[kind].name))
    motors = [kind for kind in brief.blocks if library()[kind].shape == "cylinder"]
    given = getattr(task, "given", Machine((ROOT,)))
    need = [kind for kind, count in brief.required.items() for _ in range(count)]
    loud = {long, *motors, *({GRABBER} & set(brief.blocks))}
    machines = []
    for kinds in (
        [long] * BLOCKS,
        *([kind, long] * BLOCKS for kind in loud),
        sorted(loud) * BLOCKS,
    ):
        steps, kinds = list(given), [*need, *kinds]
        for kind in kinds[: BLOCKS - len(steps)]:
            parent = max(step.id for step in steps if library()[step.type].faces)
            steps.append(Step(len(steps), kind, 0 if given.steps[0].type else parent, 0))
        machines.append(Machine(tuple(steps)))
    return machines


def chaos(task: Task, seed: int) -> Trace:
    """Far positions of either sign, loads that wander, a root that tumbles, motors that stall."""
    chance = np.random.default_rng(seed)
    samples = round(task.window / 0.2) + 1
    names = tuple(item.name for item in task.scene().objects if item.mass)

    def path(count: int) -> np.ndarray:  # type: ignore[type-arg]
        return chance.uniform(-999, 999, (samples, count, 3))

    turns = chance.normal(size=(samples, BLOCKS, 4))
    alive: Flags = np.ones((samples, BLOCKS), dtype=bool)
    return make_trace(
        BLOCKS,
        samples,
        position=path(BLOCKS),
        centre=path(BLOCKS),
        velocity=path(BLOCKS),
        rotation=turns / np.linalg.norm(turns, axis=2, keepdims=True),
        alive=alive,
        utilisation=chance.uniform(0, 1, (samples, BLOCKS - 1)),
        connections=tuple((i, i - 1) for i in range(1, BLOCKS)),
        object_position=path(len(names)),
        object_rotation=np.tile((0.0, 0.0, 0.0, 1.0), (samples, len(names), 1)),
        object_velocity=path(len(names)),
        objects=names,
    )


def told(task: Task, machine: Machine, seed: int) -> Rollout:
    """One rollout of a machine of which every joint breaks."""
    chance, trace = random.Random(seed), chaos(task, seed)
    world = Turmoil(chance, ["ground", *(item.name for item in task.scene().objects)])
    referee = task.referee(machine)
    referee.start(world)
    for step in range(1, round(task.window * 10) + 1):
        world.time = step / 10
        referee.watch(world)
    verdict = referee.verdict(trace)
    stalls = stalled_motors(machine, trace, task.schedule.switches())
    verdict = replace(verdict, events=(*verdict.events, *stalls))
    broken = tuple(
        Broken(i, machine[i].type, i - 1, task.window - 0.01 * i, 1.234) for i in range(1, BLOCKS)
    )
    feedback = task.feedback(machine, trace, broken, verdict)
    rollout = make_rollout(trace, broken)
    return replace(rollout, score=verdict.score, terms=verdict.terms, feedback=feedback)


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=() if name in (*LONGEST, "picking") else pytest.mark.slow)
        for name in task_names()
    ],
)
def test_feedback_for_twenty_blocks_in_turmoil_stays_short(name: str) -> None:
    task = get_task(name)
    for machine in crowd(task):
        trials = task.trials(0)
        whole = combine_trials(
            [told(trial, machine, seed) for seed, trial in enumerate(trials)], trials
        )
        check(whole.feedback)


def check(feedback: Feedback) -> None:
    assert tokens(feedback.text) < LIMIT, feedback.text
    assert all(len(path["times"]) <= MAX_SAMPLES for path in feedback.data["series"])
    assert len(feedback.data["peaks"]) <= 10
    assert len(feedback.data["contacts"]) <= 4
