"""Prompts shown without a run."""

from __future__ import annotations

import json

import pytest

from agentflow.agents.registry import ROLES
from agentflow.app.prompts import compare_prompt_sets, list_prompt_sets, render_prompt
from agentflow.env.tasks.registry import get_task
from agentflow.errors import UnknownNameError, UsageError
from agentflow.prompts.registry import PROMPT_SETS
from agentflow.prompts.render import PromptSet, token_estimate

BRIEF = get_task("throwing").brief


def test_the_list_names_every_set_with_its_hash() -> None:
    assert [item["name"] for item in list_prompt_sets()] == list(PROMPT_SETS)
    assert {item["digest"] for item in list_prompt_sets()} == {
        PromptSet(name).digest for name in PROMPT_SETS
    }


def test_the_default_set_has_prompts_for_every_role() -> None:
    assert tuple(sorted(ROLES)) == PromptSet().roles


@pytest.mark.parametrize("role", ROLES)
@pytest.mark.parametrize("name", PROMPT_SETS)
def test_a_prompt_and_its_length(role: str, name: str) -> None:
    found = render_prompt(name, role, BRIEF)
    assert "Task: throwing\n" in found["user"]
    assert found["tokens"] == token_estimate(found["system"]) + token_estimate(found["user"])
    assert found["digest"] == PromptSet(name).digest


def test_a_given_machine_is_in_the_prompt() -> None:
    steps = [
        {"type": 0, "id": 0, "parent": -1, "face_id": -1},
        {"type": 63, "id": 1, "parent": 0, "face_id": 2},
    ]
    assert (
        "1 Log: on 0.2 Left"
        in render_prompt("default", "refiner", BRIEF, json.dumps(steps))["user"]
    )
    with pytest.raises(UsageError, match=r"^no machine to show: "):
        render_prompt("default", "refiner", BRIEF, "[]")


def test_unknown_role() -> None:
    with pytest.raises(UnknownNameError, match=r"^unknown role 'refine'; known: refiner, "):
        render_prompt("default", "refine", BRIEF)


def test_prompt_sets_are_compared() -> None:
    assert compare_prompt_sets("default", "default") == ""
    lines = compare_prompt_sets("default", "no_motion").splitlines()
    assert lines[:2] == ["--- default/_parts/motion.j2", "+++ no_motion/_parts/motion.j2"]
    assert sum(line.startswith("+++ ") for line in lines) == 1
