"""Connections that nearly break, in real rollouts."""

from __future__ import annotations

import numpy as np

from agentflow.env.constants import Constants, constants
from agentflow.env.rollout import Rollout
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.registry import get_task
from tests.env.machines import CAR

TASK = get_task("movement", {"window": 1})


def weakened(factor: float) -> Constants:
    """The constants with the strength of every connection times `factor`, and the same steps."""
    value = constants()
    changes = {"fine_load": value["fine_load"] / factor}
    for name in ("strength_force", "strength_torque"):
        changes[name] = factor * value[name]
        changes |= {f"{name}.{kind}": factor * own for kind, own in value.by_type[name].items()}
    return value.changed(changes)


def loaded(share: float) -> tuple[tuple[int, int], Rollout]:
    """The car whose most loaded connection would be loaded to `share` of its strength if nothing
    broke: that connection and the rollout."""
    trace = simulate(CAR, TASK, interval=1 / 120).trace
    assert trace is not None
    most = trace.utilisation.max(axis=0)
    connection = trace.connections[int(np.argmax(most))]
    return connection, simulate(CAR, TASK, physics=weakened(most.max() / share))


def test_a_connection_at_97_percent_of_its_strength_is_named() -> None:
    connection, rollout = loaded(0.97)
    assert rollout.broken == ()
    (named,) = rollout.marginal
    assert (named.block, named.partner) == connection
    assert round(named.load, 6) == 0.97


def test_a_connection_that_breaks_at_up_to_103_percent_is_named() -> None:
    connection, rollout = loaded(1.03)
    broken, named = rollout.broken[0], rollout.marginal[0]
    assert (named.block, named.partner) == (broken.block, broken.partner) == connection
    assert (named.time, named.load) == (broken.time, broken.load)
    assert 1.0 <= round(named.load, 6) <= 1.03


def test_no_connection_at_80_percent_of_its_strength_is_named() -> None:
    _, rollout = loaded(0.8)
    assert (rollout.status, rollout.broken, rollout.marginal) == ("ok", (), ())
