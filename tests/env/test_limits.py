"""What an engine cannot hold is named by the check, before anything is simulated."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import combinations
from random import Random

import pytest

from agentflow.app.machines.files import check as check_data
from agentflow.env.constants import constants
from agentflow.env.physics.assembly import assemble
from agentflow.env.physics.engine import Engine, EngineSpec, TooLargeError
from agentflow.env.physics.engines import engine_limits
from agentflow.env.scene import Scene
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.registry import FAMILIES, get_task
from agentflow.errors import ConfigError
from agentflow.machine import ROOT, Machine, Step, check, library, place
from agentflow.machine.brief import Limits
from agentflow.machine.geometry.mobility import find_loops
from agentflow.machine.geometry.pieces import extra_bonds, parent_bonds
from agentflow.machine.geometry.placement import place_step
from agentflow.machine.geometry.pose import Placed

NO_BUDGET: Mapping[str, object] = {"blocks.max": 0}
BRACE = 7
TYPES = (1, 2, 5, 9, 15, 16, 22, 50, 63)


def free_faces(placed: Mapping[int, Placed], steps: list[Step]) -> list[tuple[int, int]]:
    taken = {(step.parent, step.face_id) for step in steps if not step.two_ended}
    open_faces = {at: library()[block.type].open_faces for at, block in placed.items()}
    faces = ((at, face) for at, found in open_faces.items() for face in found)
    return [end for end in faces if end not in taken]


def overlaps(new: Placed, others: Iterator[Placed]) -> bool:
    axes = range(3)
    return any(
        all(new.lo[i] < old.hi[i] and old.lo[i] < new.hi[i] for i in axes)
        for old in others
        if not old.two_ended
    )


def large_machine(rng: Random) -> Machine:
    """A random machine of 41 to 200 blocks; braces are up to half of them."""
    count, braces = rng.randint(41, 200), rng.random() / 2
    steps, placed = [ROOT], {0: place(Machine((ROOT,)))[0]}
    joined: set[frozenset[tuple[int, int]]] = set()
    while len(steps) < count:
        ends = rng.sample(free_faces(placed, steps), 2)
        if len(steps) > 9 and rng.random() < braces:
            if ends[0][0] == ends[1][0] or frozenset(ends) in joined:
                continue
            joined.add(frozenset(ends))
            step = Step(len(steps), BRACE, *ends[0], *ends[1])
        else:
            kind = rng.choice([kind for kind in TYPES if not library()[kind].linear])
            step = Step(len(steps), kind, *ends[0])
        new = place_step(step, placed)
        if new.two_ended or not overlaps(new, iter(placed.values())):
            steps.append(step)
            placed[step.id] = new
    return Machine(tuple(steps))


def large_machines(count: int) -> Iterator[Machine]:
    rng = Random(16)
    return (large_machine(rng) for _ in range(count))


def moving_joints_in_loops(machine: Machine) -> set[int]:
    """Blocks whose moving joints are in loops."""
    geometry = place(machine)
    bonds = [*parent_bonds(geometry), *extra_bonds(geometry)]
    loops = find_loops(bonds, range(len(bonds)), lambda end: end)
    return {bonds[i].block for loop in loops for i, _ in loop if bonds[i].kind != "fixed"}


def is_held(engine: Engine, machine: Machine) -> bool:
    try:
        engine.build(assemble(machine, place(machine), constants()), Scene(), 120.0)
    except TooLargeError:
        return False
    return True


def agreements(engine: Engine, spec: EngineSpec, count: int) -> list[bool]:
    """Whether each machine is held, where check and engine must agree; except that check may refuse
    one with moving joints in loops, as breaks could make all of them close a loop."""
    limits, found = Limits((999.0, 999.0, 999.0), parts=spec.most_parts), []
    for machine in large_machines(count):
        problems = check(machine, limits=limits).problems
        assert {problem.code for problem in problems} <= {"too_many_parts"}
        held = is_held(engine, machine)
        assert held or problems, machine.digest
        assert not (held and problems) or moving_joints_in_loops(machine), problems
        found.append(held)
    return found


@pytest.mark.slow
def test_check_and_engine_agree(engine: Engine, engine_spec: EngineSpec) -> None:
    found = agreements(engine, engine_spec, 40)
    assert engine_spec.most_parts is None or {*found} == {True, False}


def test_a_moving_joint_that_closes_a_loop_counts_as_a_part(
    engine: Engine, engine_spec: EngineSpec
) -> None:
    """A brace between two ball joints, which can swing, and a row of blocks."""
    most = engine_spec.most_parts
    for count in (most - 1, most) if most else ():
        rows = [(44, 0, 0), (44, 0, 1), (BRACE, 1, 0, 2, 0), (15, 0, 2)]
        rows += [(15, i, 0) for i in range(4, count - 2)]
        machine = Machine((ROOT, *(Step(i, *row) for i, row in enumerate(rows, 1))))
        assert sum(library()[step.type].parts for step in machine) == count
        problems = check(machine, limits=Limits((999.0, 999.0, 999.0), parts=most)).problems
        assert [problem.code for problem in problems] == ["too_many_parts"] * (count == most)
        assert is_held(engine, machine) == (count < most)


@pytest.mark.pybullet
def test_a_check_without_a_task_names_what_the_default_engine_cannot_hold() -> None:
    chains = [(15, 0, face) for face in range(4)]
    chains += [(15, parent, 0) for parent in range(1, 25)]  # four chains of seven blocks
    steps = [ROOT, *(Step(i, *row) for i, row in enumerate(chains, 1))]
    ends = list(combinations(range(1, 29), 2))[:50]
    braces = (Step(i, BRACE, a, 1, b, 1) for i, (a, b) in enumerate(ends, 29))
    machine = Machine((*steps, *braces)).to_json()
    assert check_data(machine[:-1], None, geometry=False)["machine_valid"]
    report = check_data(machine, None, geometry=False)
    assert not report["machine_valid"]
    assert [problem["message"] for problem in report["problems"]] == [
        "the machine has 129 parts in one piece; pybullet holds at most 128: "
        "remove blocks (a two-ended block has 2 parts, a moving joint in a loop counts as one more)"
    ]


@pytest.mark.parametrize("name", FAMILIES)
def test_every_family_has_the_limits_of_its_level(name: str) -> None:
    assert get_task(name).brief.limits.blocks == 40
    assert get_task(name, NO_BUDGET).brief.limits.blocks is None
    assert get_task(name, {"blocks.max": "25"}).brief.limits.blocks == 25
    assert get_task(name).brief.limits.parts == engine_limits().parts


@pytest.mark.parametrize("value", [-1, 10**6, "many", 4.5])
def test_other_budgets_are_refused_with_the_range(value: object) -> None:
    with pytest.raises(ConfigError) as caught:
        get_task("throwing", {"blocks.max": value})
    assert str(caught.value) == (f"blocks.max of throwing must be 0 to 800 blocks, not {value!r}")


def test_machines_of_records_may_break_later_rules() -> None:
    """Ten blocks where eight are allowed, with a spring that is there twice."""
    rows = [(15, 0, face) for face in range(6)]
    steps = [Step(i, *row) for i, row in enumerate(rows, 1)]
    springs = Step(7, 9, 1, 0, 2, 0), Step(8, 9, 2, 0, 1, 0), Step(9, 7, 1, 0, 2, 0)
    machine = Machine((ROOT, *steps, *springs))
    task = replace(get_task("jumping", {"blocks.max": 8, "window": 1}), trial=1)
    refused = simulate(machine, task)
    codes = [problem["code"] for problem in refused.problems]
    assert (refused.status, codes) == ("invalid", ["duplicate_connection", "too_many_blocks"])
    assert simulate(machine, task, recorded=True).status == "ok"
