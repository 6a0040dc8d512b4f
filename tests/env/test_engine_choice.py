"""How an engine is chosen by name, for tasks, rollouts and stores."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from agentflow.env.physics.engine import AUTO
from agentflow.env.physics.engines import (
    choose_engine,
    default_engine,
    engine_limits,
    installed_engines,
)
from agentflow.env.physics.registry import ENGINES
from agentflow.env.pool.store import rollout_key
from agentflow.env.tasks.registry import get_level, get_task, make_task, task_names
from agentflow.errors import UnknownNameError
from agentflow.machine import ROOT, Machine
from tests.loops import for_each
from tests.test_plugins import python

CAR = Path(__file__).parent.parent.parent / "examples" / "car.json"


def test_auto_is_the_first_that_is_installed() -> None:
    assert choose_engine(AUTO) is default_engine() is installed_engines()[0]
    assert [choose_engine(spec.name) for spec in installed_engines()] == [*installed_engines()]


def test_an_unknown_engine_is_refused_with_the_known_ones() -> None:
    with pytest.raises(UnknownNameError) as caught:
        get_task("movement", engine="bullet")
    assert str(caught.value).startswith("unknown physics engine 'bullet'; known: pybullet, ")
    assert "auto" in str(caught.value)


@for_each(task_names())
def test_limits_follow_the_engine_of_the_task(name: str) -> None:
    for engine in ENGINES:
        task = make_task(get_level(name), {}, engine)
        assert task.brief.limits.parts == ENGINES[engine].most_parts
        assert {trial.engine for trial in task.trials(0)} == {engine}


def test_a_task_for_an_engine_that_is_not_known_here_can_be_read() -> None:
    assert engine_limits("of-somebody-else").parts is None
    task = make_task(get_level("movement"), {}, "of-somebody-else")
    assert task.brief.limits.parts is None


def test_stores_tell_engines_apart() -> None:
    machine, task = Machine((ROOT,)), get_task("movement")
    keys = {rollout_key(machine, replace(task, engine=e.name), 0) for e in installed_engines()}
    assert len(keys) == len(installed_engines())
    assert rollout_key(machine, task, 0) in keys


@pytest.mark.slow
def test_engines_by_name(tmp_path: Path) -> None:
    """A second engine, and a third whose library is missing, come from another distribution."""
    code = """
import asyncio, sys
from pathlib import Path
import agentflow
from agentflow.env.pool.pool import RolloutPool
from agentflow.errors import ConfigError
car = Path(sys.argv[1])
print(*(agentflow.simulate(car, "movement", engine=e).engine.split()[0] for e in ("auto", "toy")))
async def both():
    async with RolloutPool(1) as pool:
        names = "toy", "pybullet", "toy"
        return [await agentflow.simulate_async(car, "movement", pool, engine=e) for e in names]
rollouts = asyncio.run(both())
print(*(r.engine.split()[0] for r in rollouts), len({r.score for r in rollouts}))
print(agentflow.reward("movement", car.read_text(), engine="toy").rollout.engine.split()[0])
try:
    agentflow.check(car, engine="absent")
except ConfigError as error:
    print(error)
"""
    *lines, error = python(code, str(CAR), cwd=tmp_path).splitlines()
    assert lines == [f"{default_engine().name} toy", "toy pybullet toy 1", "toy"]
    others = ", ".join(spec.name for spec in installed_engines())
    assert error == (
        "the physics engine 'absent' needs no-such-library; install it, or use one that is "
        f"installed: {others}, toy"
    )
