"""What every registered role owes, and the stage that a call is counted in."""

from __future__ import annotations

from typing import get_args

import pytest

from agentflow.agents.registry import ROLES, model_roles, stage_of
from agentflow.errors import UnknownNameError
from agentflow.prompts.render import PromptSet
from agentflow.runs.places import Place, StageName
from tests.agents.fakes import THROWER, THROWING


@pytest.mark.parametrize("name", ROLES)
def test_every_role_is_complete(name: str) -> None:
    role = ROLES[name]()
    assert role.name == name
    assert role.stage in get_args(StageName)
    assert all(count > 0 for count in role.tokens)
    assert (role.model_role or name) in model_roles()
    given = role.sample(THROWING, THROWER)
    system, user = PromptSet().render(name, role.variables(given))
    assert system.strip()
    assert THROWING.objective in user
    assert role.parse("", given).output is None


def test_by_name() -> None:
    assert ROLES["placer"].model_role == "designer"
    assert model_roles() == (
        "meta_designer",
        "designer",
        "inspector",
        "querier",
        "refiner",
        "agent",
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
    place = Place.parse(label)
    assert stage_of(place.role, place.purpose) == stage
