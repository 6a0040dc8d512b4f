"""Control programs of the procedural model: at first everything is on, then it changes them."""

from __future__ import annotations

from agentflow.agents.refiner import RefinerInput
from agentflow.llm.procedural.reading import read_listing
from agentflow.machine import check, describe_text
from agentflow.machine.controls import driven_blocks
from agentflow.machine.description.geometry_info import list_text
from tests.env.levels import designed_task
from tests.llm.procedural.asking import refinement, whole_design
from tests.machine.test_control_edits import DRIVEN

BRIEF = designed_task().brief


async def test_designs_switch_everything_on() -> None:
    found = [await whole_design(BRIEF, seed) for seed in range(4)]
    machines = [design.machine for design in found if design is not None]
    assert len(machines) >= 3
    for machine in machines:
        assert check(machine, BRIEF).task_valid
        groups = {*driven_blocks(machine).values()} - {"grabbers", "decouplers"}
        assert {each.target for each in machine.controls} >= groups
        assert any(each.level == 1.0 and each.lasts == 5.0 for each in machine.controls)


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
