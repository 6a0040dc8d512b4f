"""Machines that try to fool a score, on real physics: none earns anything."""

from __future__ import annotations

import pytest

from agentflow.env.rollout import Rollout
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.registry import get_level, get_task, task_names
from agentflow.machine.tree import ROOT, Machine, Step
from benchmarks.shelf import Cheat, families, load, read
from tests.env.machines import machine

LONE_ROOT = Machine((ROOT,))
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

MACHINES = {
    "a boulder that rests in a container": (ROOT, Step(1, 30, 0, 4), Step(2, 36, 1, 0)),
    "a car that carries its boulder": (
        *CAR,
        Step(7, 15, 0, 4),
        Step(8, 30, 7, 0),
        Step(9, 36, 8, 0),
    ),
    "a car that pushes its boulder": (*CAR, Step(7, 15, 1, 0), Step(8, 36, 7, 0)),
    "a tower that tips over forward with the boulder on top": (
        *TOWER,
        Step(4, 63, 3, 2),
        Step(5, 36, 4, 0),
    ),
    "a boulder that drops off a beam": (*TOWER, Step(4, 63, 3, 4), Step(5, 36, 4, 0)),
}
NEGLIGIBLE = 0.01
"""Metres: what contact softness moves."""


def throw(steps: tuple[Step, ...], **settings: bool) -> Rollout:
    return simulate(Machine(steps), get_task("throwing"), **settings)


@pytest.mark.parametrize("name", MACHINES)
@pytest.mark.slow
def test_a_cheat_throws_nothing(name: str) -> None:
    rollout = throw(MACHINES[name])
    assert rollout.status == "ok", rollout.problems
    assert rollout.score == 0.0, rollout.feedback.text


@pytest.mark.parametrize("power", [False, True])
@pytest.mark.parametrize("family", TIPPING)
@pytest.mark.slow
def test_what_is_on_the_point_of_tipping_has_tipped_before_it_counts(
    family: str, power: bool
) -> None:
    rollout = simulate(TIPPING[family], get_task(family), power=power)
    assert rollout.status == "ok", rollout.problems
    assert [event for event in rollout.events if event.kind == "unsettled"] == []
    assert rollout.score is not None
    assert rollout.score < 0.05


@pytest.mark.parametrize("name", [name for name in task_names() if name.startswith("movement")])
def test_a_lone_root_goes_nowhere(name: str) -> None:
    score = simulate(LONE_ROOT, get_task(name)).score
    assert score is not None
    assert score < NEGLIGIBLE


def test_a_tower_that_falls_forward_drives_nowhere() -> None:
    leaning = (*TOWER, Step(4, 63, 3, 2), Step(5, 35, 4, 0), Step(6, 35, 5, 0))
    rollout = simulate(Machine(leaning), get_task("movement"))
    assert rollout.status == "ok", rollout.problems
    assert rollout.score is not None
    assert rollout.score < NEGLIGIBLE


def test_a_car_drives_only_with_power() -> None:
    task = get_task("movement")
    on, off = (simulate(Machine(CAR), task, power=power).score for power in (True, False))
    assert on is not None
    assert off is not None
    assert 40.0 < on < 50.0
    assert off < NEGLIGIBLE


QUICK = {"gearing"}
"""Every other level is looked at in the slow part; in the fast one, test_determinism.py repeats
movement and throwing, and test_references.py knows scores of others to the last digit."""


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=() if name in QUICK else pytest.mark.slow) for name in task_names()],
)
def test_the_same_level_is_the_same_world_everywhere(name: str) -> None:
    machine = Machine(MACHINES["a car that carries its boulder"])
    task = get_task(name)
    if task.family == "rocket":
        machine = load("rocket/two_engines.json")
    elif not task.brief.required:
        given = Machine(CAR) if 2 in task.brief.blocks else Machine(CHASSIS)
        machine = given if task.brief.given == LONE_ROOT else task.brief.given
    trials, again = get_task(name).trials(7), get_task(name).trials(7)
    assert [trial.scene(machine) for trial in trials] == [trial.scene(machine) for trial in again]
    first, second = (simulate(machine, drawn[-1], seed=7) for drawn in (trials, again))
    assert first.status == "ok", first.problems
    assert (first.digest, first.score) == (second.digest, second.score)


LISTED = tuple(
    (cheat, level)
    for family in families()
    for cheat in read(family).cheats
    for level in cheat.levels
)
MOST = 0.05
"""Share of a good score that a cheat may be allowed, because contacts move a little."""


def named(case: tuple[Cheat, str]) -> str:
    return f"{case[0].machine} at {case[1]}"


@pytest.mark.slow
@pytest.mark.parametrize("case", LISTED, ids=named)
def test_every_listed_cheat_earns_nothing(case: tuple[Cheat, str]) -> None:
    """A lone root has not the blocks that some tasks require, which is worth 0 as well."""
    cheat, level = case
    assert cheat.most <= MOST * get_level(level).file.good
    tree = load(cheat.machine)
    rollout = simulate(tree, get_task(level))
    assert rollout.status == ("ok" if len(tree) > 1 else rollout.status), rollout.problems
    assert rollout.score is not None
    assert rollout.score <= cheat.most, rollout.feedback.text


def test_there_are_cheats_enough_for_every_level() -> None:
    """At least 25 machines, among them the lone root, which scores nothing on any level."""
    machines = {cheat.machine for cheat, _ in LISTED}
    assert len(machines) >= 25
    assert {level for cheat, level in LISTED if cheat.machine == "common/lone_root.json"} == set(
        task_names()
    )
