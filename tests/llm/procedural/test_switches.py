"""Every role with every pair of switches, for every family: replies parse, runs end well."""

from __future__ import annotations

from functools import cache
from itertools import combinations, product
from random import Random
from typing import Any

import pytest

from agentflow.agents.base import AskContext
from agentflow.agents.registry import scripts
from agentflow.env.tasks.registry import task_names
from agentflow.errors import UsageError
from agentflow.llm.procedural import ProceduralClient
from agentflow.machine.brief import LONE_ROOT
from agentflow.machine.validity import check
from agentflow.workflows.registry import WORKFLOWS, check_fit
from agentflow.workflows.settings import WorkflowSettings
from tests.llm.procedural.asking import PROMPTS, brief_of
from tests.workflows.fakes import Notes, Shelf

FAMILIES = [name for name in task_names() if "/" not in name]
DESIGNED = [name for name in FAMILIES if brief_of(name).given == LONE_ROOT]
GIVEN = [name for name in FAMILIES if name not in DESIGNED]
TINY = {
    "trajectories": 2,
    "search": {"rounds": 1, "width": 2, "request_rounds": 2},
    "candidates_per_stage": 2,
    "max_simulations": 6,
}
SWITCHES: dict[str, tuple[object, ...]] = {
    "representation": ("tree", "coordinates"),
    "refinement": ("steps", "whole_machine"),
    "meta_designer": ("structures", "detailed", "off"),
    "feedback": ("active", "basic", "score_only"),
    "spatial": (True, False),
}
"""Switches that change the content of prompts or the format of replies."""
OTHERS = ("inspector", "querier", "history", "vision")
"""Switches that add or omit a section."""
CHOICES: dict[str, tuple[object, ...]] = {
    "task": tuple(DESIGNED),
    **SWITCHES,
    **dict.fromkeys(OTHERS, (True, False)),
}


def pairs(switches: dict[str, Any]) -> set[tuple[tuple[str, object], ...]]:
    return set(combinations(switches.items(), 2))


@cache
def pairwise() -> tuple[dict[str, Any], ...]:
    """Combinations in which every two settings of two switches meet, and each meets every family.

    Each is the one of many random combinations that holds the most pairs that none held before.
    """
    chance = Random(0)
    missing = {
        ((one, first), (two, second))
        for one, two in combinations(CHOICES, 2)
        for first, second in product(CHOICES[one], CHOICES[two])
    }
    found = []
    while missing:
        drawn = ({name: chance.choice(CHOICES[name]) for name in CHOICES} for _ in range(500))
        found.append(max(drawn, key=lambda switches: len(pairs(switches) & missing)))
        missing -= pairs(found[-1])
    return tuple(found)


async def run(task: str, name: str, switches: dict[str, Any]) -> None:
    """A tiny run: its role reads every reply, and the result is a valid machine."""
    brief, notes = brief_of(task), Notes()
    context = AskContext(ProceduralClient(1, scripts()), PROMPTS, max_retry=5)
    settings = WorkflowSettings.model_validate({**TINY, **switches})
    result = await WORKFLOWS[name](brief, lambda _: context, Shelf(), settings, notes)
    attempts = notes.of("attempt")
    lost = {label: data["problem"] for label, data in attempts.items() if not data["parsed"]}
    assert attempts
    assert not lost, (task, name, switches)
    assert result.best is not None, (task, name, switches, result.reason)
    assert result.best.machine is not None
    assert check(result.best.machine, brief).task_valid


def without_task(switches: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in switches.items() if name != "task"}


def test_all_pairs_are_in_few_combinations() -> None:
    assert len(pairwise()) <= 40  # of 11,520


@pytest.mark.slow
@pytest.mark.parametrize("part", range(4))
async def test_every_two_switches(part: int) -> None:
    for switches in pairwise()[part::4]:
        await run(str(switches["task"]), "hierarchical", without_task(switches))


@pytest.mark.slow
@pytest.mark.parametrize(("number", "task"), list(enumerate(FAMILIES)))
async def test_every_workflow_that_fits(number: int, task: str) -> None:
    """With one representation or the other; hierarchical has both, with every family, above."""
    fitting = {name for name in WORKFLOWS if WORKFLOWS[name].asks_models and fits(name, task)}
    designing = ("single", "iterative", "hierarchical", "tools")
    assert fitting == ({"placement"} if task in GIVEN else {*designing})
    for name in sorted(fitting):
        shift = number + designing.index(name) if name in designing else 0
        representation = ("tree", "coordinates")[shift % 2] if task in DESIGNED else "tree"
        await run(task, name, {"representation": representation})


def fits(name: str, task: str) -> bool:
    try:
        check_fit(name, brief_of(task))
    except UsageError:
        return False
    return True
