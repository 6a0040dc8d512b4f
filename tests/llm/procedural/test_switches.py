"""Every role in every combination of switches, for every family: replies parse, runs end well."""

from __future__ import annotations

from itertools import product
from typing import Any

import pytest

from agentflow.agents.base import AskContext
from agentflow.env.tasks.registry import task_names
from agentflow.errors import UsageError
from agentflow.llm.procedural import ProceduralClient
from agentflow.machine.brief import LONE_ROOT
from agentflow.machine.validity import check
from agentflow.workflows.registry import WORKFLOWS, check_fit
from agentflow.workflows.settings import WorkflowSettings
from tests.llm.procedural.asking import PROMPTS, brief_of
from tests.workflows.world import Notes, Shelf

FAMILIES = [name for name in task_names() if "/" not in name]
DESIGNED = [name for name in FAMILIES if brief_of(name).given == LONE_ROOT]
GIVEN = [name for name in FAMILIES if name not in DESIGNED]
TINY = {
    "trajectories": 2,
    "search": {"rounds": 1, "width": 2, "waves": 2},
    "candidates_per_stage": 2,
    "rollouts": 6,
}
SWITCHES: dict[str, tuple[object, ...]] = {
    "representation": ("tree", "coordinates"),
    "refinement": ("steps", "whole_machine"),
    "meta_designer": ("modules", "detailed", "off"),
    "feedback": ("active", "basic", "score_only"),
    "spatial": (True, False),
}
"""Switches that change the content of prompts or the format of replies; all are combined."""
OTHERS = ("inspector", "querier", "history", "vision")
"""Switches that add or omit a section; they vary from one combination to the next."""


def combinations() -> list[dict[str, Any]]:
    """All of SWITCHES, each with another setting of OTHERS."""
    return [
        {
            **dict(zip(SWITCHES, values, strict=True)),
            **{name: bool(number >> bit & 1) for bit, name in enumerate(OTHERS)},
        }
        for number, values in enumerate(product(*SWITCHES.values()))
    ]


async def run(task: str, name: str, switches: dict[str, Any]) -> None:
    """A tiny run: its role reads every reply, and the result is a valid machine."""
    brief, notes = brief_of(task), Notes()
    context = AskContext(ProceduralClient(1), PROMPTS, max_retry=5)
    settings = WorkflowSettings.model_validate({**TINY, **switches})
    result = await WORKFLOWS[name](brief, lambda _: context, Shelf(), settings, notes)
    attempts = notes.of("attempt")
    lost = {label: data["problem"] for label, data in attempts.items() if not data["parsed"]}
    assert attempts
    assert not lost, (task, name, switches)
    assert result.best is not None, (task, name, switches, result.reason)
    assert result.best.machine is not None
    assert check(result.best.machine, brief).task_valid


@pytest.mark.parametrize("task", DESIGNED)
@pytest.mark.slow
async def test_every_role_in_both_representations_and_formats(task: str) -> None:
    await run(task, "hierarchical", {})
    switches = {"representation": "coordinates", "refinement": "whole_machine"}
    await run(task, "hierarchical", switches)


@pytest.mark.slow
@pytest.mark.parametrize("task", DESIGNED)
async def test_every_combination_of_switches(task: str) -> None:
    for switches in combinations():
        await run(task, "hierarchical", switches)


@pytest.mark.slow
@pytest.mark.parametrize("task", FAMILIES)
async def test_every_workflow_that_fits(task: str) -> None:
    fitting = {name for name in WORKFLOWS if WORKFLOWS[name].asks_models and fits(name, task)}
    designing = {"single", "iterative", "hierarchical", "tools"}
    assert fitting == ({"placement"} if task in GIVEN else designing)
    for name in fitting:
        for representation in ("tree", "coordinates") if task in DESIGNED else ("tree",):
            await run(task, name, {"representation": representation})


def fits(name: str, task: str) -> bool:
    try:
        check_fit(name, brief_of(task))
    except UsageError:
        return False
    return True
