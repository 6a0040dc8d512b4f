"""Control programs of the procedural model: at first everything is on, unless its mechanism says
otherwise; then it changes them."""

from __future__ import annotations

import pytest

from agentflow.agents.refiner import RefinerInput
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.registry import get_task
from agentflow.llm.procedural.mechanisms import suitable_mechanisms
from agentflow.llm.procedural.reading import read_listing
from agentflow.machine import check, describe_text
from agentflow.machine.controls import driven_blocks
from agentflow.machine.description.geometry_info import list_text
from agentflow.machine.tree import Machine
from tests.env.levels import designed_task
from tests.llm.procedural.asking import (
    blueprint_of,
    brief_of,
    designs,
    refinement,
    whole_design,
)
from tests.machine.test_control_edits import DRIVEN

BRIEF = designed_task().brief
LANDING = "rocket/5"


async def test_designs_switch_everything_on() -> None:
    found = [await whole_design(BRIEF, seed) for seed in range(4)]
    machines = [design.machine for design in found if design is not None]
    assert len(machines) >= 3
    for machine in machines:
        assert check(machine, BRIEF).task_valid
        groups = {*driven_blocks(machine).values()} - {"grabbers", "decouplers"}
        assert {each.target for each in machine.controls} >= groups
        assert any(each.level == 1.0 and each.lasts == 5.0 for each in machine.controls)


async def landers(count: int) -> list[Machine]:
    """Whole designs of a rocket that is to land."""
    found = [await whole_design(brief_of(LANDING), seed) for seed in range(count)]
    return [design.machine for design in found if design is not None]


async def test_a_rocket_that_is_to_land_throttles_its_engines_after_a_while() -> None:
    brief = brief_of(LANDING)
    machines = await landers(6)
    in_parts = await designs(brief, await blueprint_of(brief, 0), 0, "parts")
    assert len(machines) == 6
    assert in_parts is not None
    for machine in (*machines, in_parts):
        assert check(machine, brief).task_valid
        full, weak = machine.controls
        assert full.target == weak.target == "thrusters"
        assert (full.at, full.level) == (0.0, 1.0)
        assert full.at < weak.at < full.at + full.lasts
        assert weak.at + weak.lasts == brief.limits.controls
        assert 0.0 < weak.level < 1.0
    assert len({machine.controls for machine in machines}) > 1


async def test_a_rocket_without_controls_of_its_own_gets_none() -> None:
    assert get_task("rocket/4").brief.limits.controls is None
    climbing = await whole_design(brief_of("rocket/4"), 0)
    landing = await whole_design(get_task("rocket/4", {"aim": "landing"}).brief, 0)
    for design in (climbing, landing):
        assert design is not None
        assert design.machine.controls == ()


@pytest.mark.slow
async def test_some_rockets_land_softly_in_still_air() -> None:
    still = get_task(LANDING, {"touchdown": 8, "corridor": 0, "wind.cross": 0})
    scores = [simulate(machine, still).score for machine in await landers(12)]
    assert sum(score is not None and score > 0.0 for score in scores) >= 1


async def test_refinements_change_programs_too() -> None:
    changed = 0
    for number in range(8):
        given = RefinerInput(BRIEF, DRIVEN, feedback="Score: 1.00 m", score=1.0)
        attempt = await refinement(given, 1, f"refiner/{number}")
        assert attempt.parsed.output is not None, attempt.parsed.problem
        machine = attempt.parsed.output.machine  # type: ignore[attr-defined]
        assert check(machine, BRIEF).task_valid
        changed += machine.steps == DRIVEN.steps and machine.controls != DRIVEN.controls
    assert 0 < changed < 8


def test_programs_in_prompts_are_read() -> None:
    assert read_listing(describe_text(DRIVEN, BRIEF)) == DRIVEN
    assert read_listing(list_text(DRIVEN)) == DRIVEN


@pytest.mark.parametrize(
    "task", ["rocket/6", "movement/6", "transport", "transport/6", "movement/7"]
)
async def test_machines_that_may_sense_bring_controllers_and_their_numbers_are_changed(
    task: str,
) -> None:
    brief = get_task(task, {"controls": "sensed"}).brief
    found = [await whole_design(brief, seed) for seed in range(3)]
    machines = [design.machine for design in found if design is not None]
    assert len({str(machine.controllers) for machine in machines}) == 3, "with other numbers"
    for machine in machines:
        assert check(machine, brief).task_valid
        assert machine.controllers is not None
        assert read_listing(describe_text(machine, brief)) == machine
        sensed = {output.group for output in machine.controllers.outputs}
        assert not sensed & {control.target for control in machine.controls}
    given = RefinerInput(brief, machines[0], feedback="Score: 1.00 m", score=1.0)
    replies = [(await refinement(given, 1, f"refiner/{number}")) for number in range(8)]
    edited = [reply.parsed.output.machine for reply in replies if reply.parsed.output]  # type: ignore[attr-defined]
    assert len(edited) == 8
    assert any(each.controllers != machines[0].controllers for each in edited)
    assert all(check(each, brief).task_valid for each in edited)


async def test_mechanisms_of_levels_that_need_sensors_are_theirs_alone() -> None:
    for task, name in (("movement/7", "column on two wheels"), ("transport/6", "waiting car")):
        brief = brief_of(task)
        assert [each["name"] for each in suitable_mechanisms(brief)] == [name]
        assert (await blueprint_of(brief, 0)).definition.startswith(f"{name}: "), (
            "from the prompt too"
        )
    assert [each["name"] for each in suitable_mechanisms(brief_of("transport/2"))] == [
        "steered car"
    ]
    assert [each["name"] for each in suitable_mechanisms(brief_of("movement"))] == ["car"]


@pytest.mark.slow
@pytest.mark.parametrize("task", ["movement/7", "transport/6"])
async def test_some_first_machines_succeed_in_all_trials(task: str) -> None:
    found = [await whole_design(brief_of(task), seed) for seed in range(4)]
    scores = [simulate(design.machine, get_task(task)).score for design in found if design]
    assert max(score or 0.0 for score in scores) == 10.0
