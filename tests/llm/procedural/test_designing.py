"""Blueprints and machines that the role parsers accept, for many seeds and tasks."""

from __future__ import annotations

from dataclasses import replace

import pytest

from agentflow.env.tasks.registry import task_names
from agentflow.machine.blocks.library import GRABBER
from agentflow.machine.brief import LONE_ROOT, Brief
from agentflow.machine.geometry.placement import place
from agentflow.machine.validity import check
from tests.llm.procedural.asking import blueprint_of, brief_of, designs, whole_design

DECOUPLER, WINCH = 4, 45


@pytest.mark.parametrize("task", ["throwing", "movement"])
async def test_every_blueprint_and_most_designs_are_valid(task: str) -> None:
    brief = brief_of(task)
    built = []
    for seed in range(8):
        blueprint = await blueprint_of(brief, seed)
        assert all(1 <= len(part.types) <= 3 for part in blueprint.structures)
        built += [await designs(brief, blueprint, seed, f"traj-{n}") for n in range(2)]
    machines = [machine for machine in built if machine is not None]
    assert len(machines) >= 14
    assert all(check(machine, brief).task_valid for machine in machines)
    assert len({machine.digest for machine in machines}) >= 8


@pytest.mark.parametrize("most", [12, 25])
async def test_designs_stay_within_the_budget(most: int) -> None:
    brief = brief_of("throwing")
    brief = replace(brief, limits=replace(brief.limits, blocks=most))
    found = [await whole_design(brief, seed) for seed in range(6)]
    machines = [design.machine for design in found if design is not None]
    assert len(machines) >= 5
    assert max(map(len, machines)) <= most
    assert all(check(machine, brief).task_valid for machine in machines)


MECHANISMS = {
    "throwing": {"motor arm", "counterweight arm", "spring arm"},
    "movement": {"car"},
    "delivery": {"pushing car", "fork car"},
    "jumping": {"folding jumper"},
    "lifting": {"spring lever"},
    "flying": {"two rotors", "rotor and paddles"},
    "flying/4": {"two rotors", "rotor and paddles", "thrust frame"},
    "picking": {"crane"},
    "bridge": {"braced deck", "trussed deck"},
    "transport/2": {"steered car"},
    "rocket": {"steam rocket"},
    "rocket/3": {"steam rocket"},
    "rocket/5": {"throttled rocket"},
}


@pytest.mark.parametrize("task", MECHANISMS)
async def test_the_objective_determines_the_mechanism(task: str) -> None:
    brief = brief_of(task)
    plans = [(await blueprint_of(brief, seed)).definition.partition(":")[0] for seed in range(24)]
    assert set(plans) == MECHANISMS[task]


@pytest.mark.parametrize(("task", "kinds"), [("jumping", {5, 9}), ("lifting", {5, 9})])
async def test_springs_connect_static_blocks_to_hinged_ones(task: str, kinds: set[int]) -> None:
    brief = brief_of(task)
    machine = await designs(brief, await blueprint_of(brief, 4), 4, "t")
    assert machine is not None
    assert kinds < {step.type for step in machine}
    hinge = next(step.id for step in machine if step.type == 5)
    spring = next(step for step in machine if step.type == 9)
    moved = {hinge}
    for step in machine:
        if step.type != 9 and step.parent in moved:
            moved.add(step.id)
    assert len(moved.intersection(spring.parents)) == 1


async def test_vertical_winches_hold_a_hook_of_grabbers_on_a_crane() -> None:
    brief = brief_of("picking")
    machine = await designs(brief, await blueprint_of(brief, 0), 0, "t")
    assert machine is not None
    blocks = place(machine).blocks
    decoupler = next(block.id for block in blocks if block.type == DECOUPLER)
    assert {block.facing for block in blocks if block.type in (DECOUPLER, GRABBER)} == {"y-"}
    assert min(block.id for block in blocks if block.type == GRABBER) > decoupler
    ropes = [block for block in blocks if block.type == WINCH]
    assert len(ropes) >= 2
    for rope in ropes:
        high, low = rope.step.parents
        assert high < decoupler < low
        assert rope.end_a is not None
        assert rope.end_b is not None
        assert (rope.end_a[0], rope.end_a[2]) == (rope.end_b[0], rope.end_b[2])
        assert rope.end_a[1] > rope.end_b[1]


WHOLE = [name for name in task_names() if brief_of(name).given == LONE_ROOT]
"""Tasks whose machines are designed from scratch; the others complete a given machine."""


@pytest.mark.parametrize(
    "task",
    [pytest.param(name, marks=pytest.mark.slow if "/" in name else ()) for name in WHOLE],
)
async def test_a_whole_machine_in_one_reply(task: str) -> None:
    brief = brief_of(task)
    made = [await whole_design(brief, seed) for seed in range(6)]
    assert sum(design is not None for design in made) >= 5


FOREIGN = (
    (0, 38, 51),
    (0, 15),
    (0, 2, 41),
    (0, 7, 15),
    (0, 14, 22, 26, 55),
    (0, 5, 13, 19, 28, 40, 44, 50, 60, 76, 86),
)


@pytest.mark.parametrize("blocks", FOREIGN)
async def test_any_block_list_gives_a_valid_machine(blocks: tuple[int, ...]) -> None:
    brief = replace(brief_of("movement"), name="nobody-knows", blocks=blocks)
    blueprint = await blueprint_of(brief, 1)
    machine = await designs(brief, blueprint, 1, "t")
    assert machine is not None
    assert check(machine, brief).task_valid


async def test_a_required_block_that_no_mechanism_uses_gets_a_structure() -> None:
    brief: Brief = replace(brief_of("movement"), blocks=(0, 1, 2, 27), required={27: 1})
    blueprint = await blueprint_of(brief, 0)
    assert blueprint.structures[-1].types == (27,)
    machine = await designs(brief, blueprint, 0, "t")
    assert machine is not None
    assert machine.count(27) == 1


async def test_decks_reach_across_a_gap_that_is_longer_than_other_machines_may_be() -> None:
    found = [await whole_design(brief_of("bridge/3"), seed) for seed in range(8)]
    boxes = [place(design.machine) for design in found if design is not None]
    assert max(box.box_max[2] - box.box_min[2] for box in boxes) > 20.0
