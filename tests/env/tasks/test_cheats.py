"""Machines that try to fool a score, on real physics: none earns anything."""

from __future__ import annotations

import re
from collections import Counter

import pytest

from agentflow.env.physics.mujoco.engine import MuJoCoEngine
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.registry import get_level, get_task, task_names
from agentflow.machine.brief import LONE_ROOT
from agentflow.machine.tree import ROOT, Machine, Step
from benchmarks.shelf import Cheat, families, load, read
from tests.env.machines import machine
from tests.env.tasks.test_levels import ALMOST_NOTHING
from tests.loops import for_each

WHEELS = ((1, 2), (1, 3), (2, 2), (2, 3))
CHASSIS = (ROOT, Step(1, 1, 0, 0), Step(2, 1, 0, 1))
CAR = (*CHASSIS, *(Step(3 + i, 2, block, face) for i, (block, face) in enumerate(WHEELS)))
TOWER = (ROOT, Step(1, 1, 0, 4), *(Step(i, 1, i - 1, 0) for i in (2, 3)))

TIPPING = {
    "movement": machine(
        (0, -1, -1),
        (63, 0, 5),
        (63, 1, 0),
        (2, 2, 3),
        (2, 2, 6),
        (35, 0, 2),
        (35, 5, 0),
        (35, 0, 3),
        (35, 7, 0),
        (15, 0, 0),
        (15, 9, 0),
        (1, 0, 1),
    ),
    "throwing": machine(
        (0, -1, -1),
        (63, 0, 5),
        (1, 1, 0),
        (2, 2, 2),
        (2, 2, 4),
        (15, 0, 0),
        (63, 5, 0),
        (63, 0, 1),
        (15, 7, 0),
        (15, 0, 4),
        (36, 9, 0),
    ),
}
"""They stand on the point of tipping over, slower than what counts as rest for about a second, and
would fall 8 and 10 m."""

NEGLIGIBLE = 0.01
"""Metres: what contact softness moves."""


@pytest.mark.parametrize(("family", "power"), [("movement", True), ("throwing", False)])
@pytest.mark.slow
def test_what_is_on_the_point_of_tipping_has_tipped_before_it_counts(
    family: str, power: bool
) -> None:
    rollout = simulate(TIPPING[family], get_task(family), power=power)
    assert rollout.status == "ok", rollout.problems
    assert [event for event in rollout.events if event.kind == "unsettled"] == []
    assert rollout.score is not None
    assert rollout.score < 0.05


def test_a_tower_that_falls_forward_drives_nowhere() -> None:
    leaning = (*TOWER, Step(4, 63, 3, 2), Step(5, 35, 4, 0), Step(6, 35, 5, 0))
    rollout = simulate(Machine(leaning), get_task("movement"))
    assert rollout.status == "ok", rollout.problems
    assert rollout.score is not None
    assert rollout.score < NEGLIGIBLE


def test_energy_from_nothing_does_not_count() -> None:
    """A rotor flings its root so fast that landing it adds more energy than it ever had."""
    flung = load("common/flung_root.json")
    rollout = simulate(flung, get_task("movement/2"), engine=MuJoCoEngine())
    assert (rollout.status, rollout.score) == ("diverged", 0.0)
    first, *broken = rollout.feedback.text.splitlines()
    assert re.match(r"The simulation gained \d{4} J that no motor, spring, fall or wind", first)
    assert broken[0].startswith("Broken: block 22 (Log) off block 21 at 0.23 s")


def test_a_car_drives_only_with_power() -> None:
    task = get_task("movement")
    on, off = (simulate(Machine(CAR), task, power=power).score for power in (True, False))
    assert on is not None
    assert off is not None
    assert 40.0 < on < 50.0
    assert off < NEGLIGIBLE


def machine_for(task: Task) -> Machine:
    """Something that the task lets stand in its scene."""
    if task.family == "rocket":
        return load("rocket/two_engines.json")
    if task.brief.required:
        return load("throwing/carried_boulder.json")
    if task.brief.given != LONE_ROOT:
        return task.brief.given
    return Machine(CAR) if 2 in task.brief.blocks else Machine(CHASSIS)


@for_each(task_names())
def test_the_same_level_is_the_same_world_everywhere(name: str) -> None:
    """And gives the same rollout: test_records.py knows a score of each level to the last digit."""
    machine = machine_for(get_task(name))
    trials, again = get_task(name).trials(7), get_task(name).trials(7)
    assert [trial.scene(machine) for trial in trials] == [trial.scene(machine) for trial in again]


LISTED = tuple(
    (cheat, level)
    for family in families()
    for cheat in read(family).cheats
    for level in cheat.levels
)
LONE = "common/lone_root.json"
"""At every level; test_levels.py tries it."""


def spread() -> list[tuple[Cheat, str]]:
    """Each machine at one of its levels: where the fewest others are tried so far.

    `benchmarks/references.py --check` tries each at all of its levels.
    """
    tried, chosen = Counter[str](), {}
    for cheat, _ in sorted(LISTED, key=lambda case: len(case[0].levels)):
        if cheat.machine not in (LONE, *chosen):
            level = min(cheat.levels, key=lambda name: tried[name])
            tried[level] += 1
            chosen[cheat.machine] = (cheat, level)
    return list(chosen.values())


MOST = 0.05
"""Share of a good score that a cheat may be allowed, because contacts move a little."""


def named(case: tuple[Cheat, str]) -> str:
    return f"{case[0].machine} at {case[1]}"


@pytest.mark.slow
@pytest.mark.parametrize("case", spread(), ids=named)
def test_every_listed_cheat_earns_nothing(case: tuple[Cheat, str]) -> None:
    cheat, level = case
    rollout = simulate(load(cheat.machine), get_task(level))
    assert rollout.status == "ok", rollout.problems
    assert rollout.score is not None
    assert rollout.score <= cheat.most, rollout.feedback.text


def test_no_cheat_may_earn_much() -> None:
    for cheat, level in LISTED:
        assert cheat.most <= MOST * get_level(level).file.good, (cheat.machine, level)


def test_there_are_cheats_enough_for_every_level() -> None:
    """At least 25 machines, among them the lone root, which scores nothing on any level."""
    machines = {cheat.machine for cheat, _ in LISTED}
    assert len(machines) >= 25
    alone = {level: cheat.most for cheat, level in LISTED if cheat.machine == LONE}
    assert set(alone) == set(task_names())
    assert max(alone.values()) <= ALMOST_NOTHING
