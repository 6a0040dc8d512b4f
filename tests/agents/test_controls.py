"""Prompts and replies of tasks whose machines bring control programs."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from agentflow.agents.registry import ROLES
from agentflow.agents.replies import Representation, machine_text, read_reply
from agentflow.env.tasks.registry import get_task
from agentflow.machine import Machine
from agentflow.machine.controllers.model import QUANTITIES
from agentflow.machine.tree import Control
from agentflow.prompts.render import CONTROLLERS, CONTROLS, PromptSet
from tests.env.levels import designed_task
from tests.machine.builders import CAR

DRIVEN = replace(CAR, controls=(Control("motors", 0.0, 5.0, 1.0),))
DESIGNED, FIXED = designed_task().brief, get_task("movement").brief
_PROMPTS = PromptSet()


@pytest.mark.parametrize("name", list(ROLES))
def test_every_role_is_told_about_programs_only_where_machines_bring_them(name: str) -> None:
    role = ROLES[name]()
    told, untold = (
        _PROMPTS.render(name, role.variables(role.sample(brief, machine)))[1]
        for brief, machine in ((DESIGNED, DRIVEN), (FIXED, CAR))
    )
    assert told.count("## Controls\n") == 1
    assert '{"group": "motors", "at": 0, "for": 5, "level": 1}' in told
    assert "motors (type 2, 22)" in told
    assert told.find("## Controls") < told.find("## Your reply") or name == "agent"
    assert ("Uncontrol [number]" in told) == (name in ("refiner", "agent"))
    assert "ontrol" not in untold.replace("controls:", "")


@pytest.mark.parametrize("prompts", ["default", "compact"])
@pytest.mark.parametrize("name", ["designer", "refiner"])
def test_controllers_are_told_with_an_example_only_where_a_level_accepts_them(
    name: str, prompts: str
) -> None:
    role, rules = ROLES[name](), PromptSet(prompts)
    sensed = get_task("movement", {"controls": "sensed"}).brief
    told, untold = (
        rules.render(name, role.variables(role.sample(brief, DRIVEN)))[1]
        for brief in (sensed, DESIGNED)
    )
    lines = [line for line in told.splitlines() if '"controllers"' in line]
    example = lines[0].replace("[...]", json.dumps(CAR.to_json()))
    found = read_reply(example, sensed, "tree")
    assert found.task_valid, found.problems
    assert all(kind in told for kind in QUANTITIES)
    assert ("Controllers [JSON on one line, or none]" in told) == (name == "refiner")
    assert '"axis": "z+"' in example
    assert "outputs.0.scale" in told or name == "designer"
    assert "ontrollers" not in untold
    assert told.find("## Controls") < told.find('"controllers"') < told.find("## Your reply")


@pytest.mark.parametrize("prompts", ["default", "compact"])
def test_who_asks_queries_is_told_how_to_ask_for_controllers(prompts: str) -> None:
    sensed = get_task("movement/6").brief
    for name in ("querier", "designer"):
        role = ROLES[name]()
        told = PromptSet(prompts).render(name, role.variables(role.sample(sensed, CAR)))[1]
        assert ('{"id": "controllers", ' in told) == (name == "querier")


def test_their_template_changes_no_digest_of_other_tasks() -> None:
    assert _PROMPTS.digest_for((CONTROLS,)) != _PROMPTS.digest_for((CONTROLS, CONTROLLERS))
    assert _PROMPTS.digest_for(()) != _PROMPTS.digest_for((CONTROLS,))
    assert _PROMPTS.digest_for((CONTROLS,)) == _PROMPTS.digest_for((CONTROLS, "unknown"))


@pytest.mark.parametrize("representation", ["tree", "coordinates"])
def test_machines_with_programs_are_written_and_read_back(representation: Representation) -> None:
    text = f"So:\n```json\n{machine_text(DRIVEN, representation)}\n```"
    assert read_reply(text, DESIGNED, representation).machine == DRIVEN
    (problem,) = read_reply(text, FIXED, representation).problems
    assert problem.code == "controls_not_allowed"


def test_new_blocks_keep_the_program_unless_they_bring_one() -> None:
    start = Machine(CAR.steps[:5], DRIVEN.controls)
    rest = [step.to_json() for step in CAR.steps[5:]]
    assert read_reply(json.dumps(rest), DESIGNED, "tree", start).machine == DRIVEN
    new = {"blocks": rest, "controls": [{"blocks": [6], "at": 1, "for": 1, "level": 0}]}
    read = read_reply(json.dumps(new), DESIGNED, "tree", start).machine
    assert read == replace(CAR, controls=(Control((6,), 1.0, 1.0, 0.0),))
