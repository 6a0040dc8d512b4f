"""What every registered role owes, and the stage that a call is counted in."""

from __future__ import annotations

import re
from pathlib import Path
from typing import get_args

import pytest

import agentflow
from agentflow.agents.base import Replies
from agentflow.agents.registry import ROLES, model_roles, replies_of, scripts, stage_of
from agentflow.errors import UnknownNameError
from agentflow.prompts.render import PromptSet
from agentflow.runs.locations import Location, StageName
from agentflow.study.episodes import MEANING
from tests.agents.fakes import THROWER, THROWING


@pytest.mark.parametrize("name", ROLES)
def test_every_role_is_complete(name: str) -> None:
    role = ROLES[name]()
    assert role.name == name
    assert role.stage in get_args(StageName)
    assert all(count > 0 for count in role.tokens)
    assert (role.model_role or name) in model_roles()
    assert role.replies in get_args(Replies)
    assert set(role.labels) <= set(MEANING)
    assert role.prediction("") == ""
    given = role.sample(THROWING, THROWER)
    system, user = PromptSet().render(name, role.variables(given))
    assert system.strip()
    assert THROWING.objective in user
    assert role.parse("", given).output is None


def test_by_name() -> None:
    assert ROLES["placer"].model_role == "designer"
    assert (
        " ".join(model_roles()) == "meta_designer designer inspector querier refiner analyst agent"
    )
    with pytest.raises(UnknownNameError, match=r"^unknown role 'refine'; known: refiner, "):
        ROLES["refine"]


@pytest.mark.parametrize(
    ("label", "stage"),
    [
        ("meta_designer/attempt-1", "initial"),
        ("designer/structure-1/traj-2/candidate-1/attempt-3", "initial"),
        ("placer/traj-1/attempt-1", "initial"),
        ("inspector/traj-1/attempt-1", "blind_refinement"),
        ("refiner/blind/traj-1/attempt-1", "blind_refinement"),
        ("querier/traj-2/node-0/attempt-1", "env_feedback"),
        ("refiner/feedback/traj-2/round-1/node-0/try-1/attempt-1", "env_feedback"),
        ("somebody/else", "other"),
    ],
)
def test_stage_of_a_call(label: str, stage: str) -> None:
    location = Location.parse(label)
    assert stage_of(location.role, location.purpose) == stage


def test_what_is_not_installed_answers() -> None:
    found = {name: replies_of(name) for name in (*ROLES, "somebody")}
    others = {name: what for name, what in found.items() if what != "answers"}
    assert others == {"refiner": "edits", "agent": "calls"}


def test_scripts_are_of_the_roles_that_answer_without_tools() -> None:
    assert scripts() == tuple(role.script for role in ROLES.values() if role.replies != "calls")


HOMES = ("agents/", "prompts/")
"""Parts that roles consist of."""
EXCEPTIONS = {
    "api.py": "a default that users read in the signature",
    "app/benchmark/card.py": "a part of the benchmark, which is named as the role that it asks",
    "app/sweeps/unread.py": "settings, one of which is named as the role that it switches off",
    "cli/commands/design.py": "a default that users read in the help",
    "config/shipped.py": "a sweep, which is named as the role that it studies",
    "cli/commands/tasks.py": "a default that users read in the help",
    "integrations/verifiers/tasks.py": "an option of that library",
    "workflows/settings.py": "the settings' own names of emitters and switches",
    "workflows/workflow.py": "settings, which are named as the roles that they switch off",
    "workflows/single.py": "a setting, which is named as the role that it switches off",
    "workflows/explore.py": "an emitter, which is named as the role that it asks",
}
"""Modules elsewhere that name a role in a string, and why."""


def test_facts_of_roles_have_one_place() -> None:
    package = Path(agentflow.__file__).parent
    files = {
        str(path.relative_to(package)): path.read_text(encoding="utf-8")
        for path in (*package.rglob("*.py"), *package.glob("*/web/*.js"))
    }
    quoted = re.compile(rf"([\"'`])({'|'.join(ROLES.ours)})\1")
    naming = {name for name, text in files.items() if quoted.search(text)}
    assert {name for name in naming if not name.startswith(HOMES)} == set(EXCEPTIONS)
