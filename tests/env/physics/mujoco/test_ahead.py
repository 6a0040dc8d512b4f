"""Steps that are taken at once, compiled, are those that worlds take one by one, bit for bit; so
are those of a model that an earlier world has used."""

from __future__ import annotations

from itertools import count, islice
from random import Random
from typing import Any

import pytest

from agentflow.env.physics.mujoco import engine as mujoco_engine
from agentflow.env.physics.mujoco.engine import PATIENCE, MuJoCoEngine, compiled_steps
from agentflow.env.physics.mujoco.world import KEPT, MuJoCoWorld
from agentflow.env.simulation.simulate import simulate
from agentflow.env.simulation.trial import Trial
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.registry import get_task, task_names
from agentflow.machine.edits.random import random_machine
from agentflow.machine.tree import Machine
from tests.env.machines import shipped

pytest.importorskip("numba")
SHIPPED = {
    "published_throw": "throwing",
    "throwing/spring_arm": "throwing",
    "common/breaks_twice": "throwing",  # steps one by one follow, in which nothing touches
    "rotor_with_ballast": "movement",
    "movement/plain_car": "movement/6",
    "bridge/braced_beam": "bridge",
}


def _told(machine: Machine, task: Task, engine: MuJoCoEngine) -> Any:
    rollout = simulate(machine, task, engine=engine, cpu_limit=1e9)
    measured = rollout.trace.measured if rollout.trace else None
    contacts = (measured.contacts, measured.peaks, measured.energy) if measured else ()
    scored = (rollout.status, rollout.digest, rollout.score, rollout.terms, rollout.events)
    return repr((scored, rollout.broken, rollout.marginal, contacts, rollout.feedback))


def _compare(machine: Machine, task: Task) -> None:
    engine = MuJoCoEngine()
    engine.patience = 10**9
    one, used = _told(machine, task, engine), [id(each.built) for each in engine.kept]
    engine.patience = 0
    assert _told(machine, task, engine) == one
    assert len(used) == KEPT or used == [id(each.built) for each in engine.kept]


def test_it_is_used() -> None:
    used = []

    class Watched(MuJoCoEngine):
        def build(self, *arguments: Any) -> MuJoCoWorld:
            used.append(super().build(*arguments))
            return used[-1]

    engine = Watched()
    engine.patience = 0
    simulate(shipped("published_throw"), get_task("throwing"), engine=engine)
    assert used[0].now.ahead is not None
    assert used[0].now.ahead.taken > 0


def _simulate_throw() -> None:
    engine = MuJoCoEngine()
    engine.patience = 0
    assert simulate(shipped("published_throw"), get_task("throwing"), engine=engine).broken


def test_it_stops_where_something_breaks(monkeypatch: pytest.MonkeyPatch) -> None:
    ahead = compiled_steps()
    assert ahead is not None
    left: list[int] = []
    rewind = ahead.Ahead.rewind
    monkeypatch.setattr(
        ahead.Ahead,
        "rewind",
        lambda own: left.append(own.left) or rewind(own),  # type: ignore[func-returns-value]
    )
    _simulate_throw()
    assert {*left} == {0}


def test_calm_steps_are_passed_over(monkeypatch: pytest.MonkeyPatch) -> None:
    steps: list[int] = []
    pass_over = Trial._pass_over
    monkeypatch.setattr(
        Trial,
        "_pass_over",
        lambda own, many: steps.append(many) or pass_over(own, many),  # type: ignore[func-returns-value]
    )
    _simulate_throw()
    assert min(steps) > 0
    assert sum(steps) > 300  # of 600


@pytest.mark.parametrize("name", SHIPPED)
def test_known_machines(name: str) -> None:
    _compare(shipped(name), get_task(SHIPPED[name]))


def _random(machines: int) -> None:
    tasks = [get_task(name, engine="mujoco") for name in task_names()]
    rounds = ((turn, task) for turn in count() for task in tasks)
    due = (task for turn, task in rounds if turn % len(task.trials(0)) == 0)
    for number, task in enumerate(islice(due, machines)):
        _compare(random_machine(Random(f"ahead/{number}"), task.brief), task)


def test_a_few_random_machines() -> None:
    _random(5)


@pytest.mark.slow
def test_many_random_machines() -> None:
    _random(100)


def test_it_waits_until_it_pays(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []
    monkeypatch.setattr(mujoco_engine, "compiled_steps", lambda: asked.append(1))
    engine = MuJoCoEngine()
    engine.patience = 1
    for _ in range(2):
        simulate(shipped("movement/plain_car"), get_task("movement"), engine=engine)
    assert len(asked) == 1
    assert PATIENCE > 1


def test_without_its_library(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(name: str) -> None:
        raise ModuleNotFoundError(name=name)

    monkeypatch.setattr(mujoco_engine, "import_module", fail)
    assert compiled_steps.__wrapped__() is None
