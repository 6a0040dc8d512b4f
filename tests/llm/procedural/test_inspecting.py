"""Inspections that find outermost blocks, and queries about broken ones."""

from __future__ import annotations

import pytest

from agentflow.agents.base import ask
from agentflow.agents.inspector import Inspection, Inspector, InspectorInput
from agentflow.agents.querier import Querier, QuerierInput
from agentflow.machine.formats.parse import read_machine
from agentflow.machine.tree import Machine
from tests.llm.procedural.asking import blueprint_of, brief_of, context, designs


def machine_of(*steps: tuple[int, int, int]) -> Machine:
    """Type, parent, face of each block after the root."""
    listed = [{"type": 0, "id": 0, "parent": -1, "face_id": -1}]
    for number, (kind, parent, face) in enumerate(steps, 1):
        listed.append({"type": kind, "id": number, "parent": parent, "face_id": face})
    machine = read_machine(listed).machine
    assert machine is not None
    return machine


async def inspected(task: str, machine: Machine) -> Inspection:
    given = InspectorInput(brief_of(task), machine)
    outcome = await ask(Inspector(), given, context(0), "inspector")
    assert outcome.output is not None, outcome.attempts[0].parsed.problem
    return outcome.output


@pytest.mark.parametrize("task", ["throwing", "movement"])
async def test_it_finds_the_outermost_blocks(task: str) -> None:
    brief = brief_of(task)
    for seed in range(3):
        machine = await designs(brief, await blueprint_of(brief, seed), seed, "t")
        assert machine is not None
        assert (await inspected(task, machine)).orientation_score == 1.0


async def test_wheels_that_do_not_drive_forward_are_a_defect() -> None:
    found = await inspected("movement", machine_of((2, 0, 3), (2, 0, 0)))
    defects = [(defect.blocks, defect.text) for defect in found.defects]
    assert ((2,), "facing z+ it does not drive to z+") in defects
    assert ((1, 2), "too few wheels for a quick start") in defects


async def test_a_machine_with_its_centre_of_mass_beside_its_feet_tips() -> None:
    found = await inspected("throwing", machine_of((1, 0, 4), (63, 1, 6), (36, 2, 0)))
    defects = [defect.text for defect in found.defects]
    assert defects[0] == "the centre of mass is not above the footprint: it tips"


async def test_idle_blocks_and_one_sided_loads_are_reported() -> None:
    steps = ((1, 0, 4), (22, 1, 4), (63, 2, 2), (15, 1, 6), (36, 3, 0))
    found = await inspected("throwing", machine_of(*steps))
    defects = [(defect.blocks, defect.text) for defect in found.defects]
    assert ((2,), "unbalanced: loaded on one side only") in defects
    assert ((4,), "useless: it carries nothing and does not touch the ground") in defects


async def test_it_queries_broken_blocks_around_the_time_of_breaking() -> None:
    machine = machine_of((1, 0, 4), (15, 1, 0))
    report = "Score: 0.00 m\nBroken: block 2 (Small Wooden Block) off block 1 at 0.30 s, load 1.20"
    given = QuerierInput(brief_of("movement"), machine, 0.0, report)
    outcome = await ask(Querier(), given, context(0), "querier")
    assert outcome.output is not None
    asked = {"duration": [0.0, 0.7], "properties": ["position", "velocity"]}
    assert outcome.output == ({"id": 2, **asked}, {"id": 1, **asked})


async def test_it_queries_the_root_when_nothing_broke() -> None:
    given = QuerierInput(brief_of("movement"), machine_of((2, 0, 3)), 1.0, "Score: 1.00 m")
    outcome = await ask(Querier(), given, context(0), "querier")
    assert outcome.output is not None
    assert [query["id"] for query in outcome.output] == [1, 0]
