"""Fine steps while machines settle and start: what they cost, and scores that no longer differ."""

from __future__ import annotations

import os
import sys

import pytest

from agentflow.env.constants import constants
from agentflow.env.physics.engines import default_engine
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.registry import get_task
from tests.env.fakes import AlteredEngine, AlteredWorld
from tests.env.machines import CAR, machine
from tests.processes import run_python

CLIMBED = {
    "rotor on posts": machine(
        *((0, -1, -1), (16, 0, 2), (5, 0, 0), (1, 1, 4), (1, 0, 3), (1, 4, 8), (1, 5, 6)),
        *((15, 6, 8), (22, 6, 4), (63, 8, 3), (30, 9, 0), (36, 10, 0), (7, 6, 3, 3, 0)),
        *((63, 4, 3), (63, 3, 2)),
    ),
    "four rotors": machine(
        *((0, -1, -1), (1, 0, 1), (1, 0, 2), (1, 0, 0), (1, 2, 4), (1, 0, 4), (22, 5, 3)),
        *((1, 1, 6), (22, 7, 4), (15, 8, 3), (30, 9, 0), (36, 10, 0), (22, 3, 1), (15, 9, 4)),
        *((22, 12, 3),),
    ),
}
"""Throwers that hill climbing found, with steps of 1/120 s throughout or after 0.1 s."""


FAR, NEAR = 0.08, 0.05


def score(name: str, rate: float | None = None, fine_rate: float = 480) -> float:
    """The score of a climbed thrower; a fine rate of 0 divides no step."""
    physics = constants().changed({"fine_rate": fine_rate, "settle_rate": fine_rate})
    engine = default_engine().start(physics)
    rollout = simulate(
        CLIMBED[name], get_task("throwing"), rate=rate, physics=physics, engine=engine
    )
    engine.close()
    assert rollout.score is not None
    return rollout.score


@pytest.mark.slow
@pytest.mark.parametrize("name", CLIMBED)
def test_fine_steps_bring_a_climbed_thrower_near_its_exact_score(name: str) -> None:
    exact = score(name, 480)
    assert abs(score(name, fine_rate=0) / exact - 1) > FAR
    assert abs(score(name) / exact - 1) < NEAR


@pytest.mark.slow
def test_climbed_throwers_move_the_same_in_a_new_process() -> None:
    script = (
        "from tests.env.test_fine_steps import CLIMBED, get_task, simulate\n"
        "print(*(simulate(tree, get_task('throwing')).digest for tree in CLIMBED.values()))"
    )
    path = os.pathsep.join(sys.path)
    done = run_python("-c", script, PYTHONPATH=path, PYTHONHASHSEED="7")
    here = [simulate(CLIMBED[name], get_task("throwing")).digest for name in reversed(CLIMBED)]
    assert done.stdout.split() == here[::-1]


@pytest.mark.pybullet
@pytest.mark.parametrize(
    ("rate", "steps"),
    [
        (120, [(4, 40), (4, 12), (1, 108)]),
        (240, [(2, 84), (2, 24), (1, 216)]),
        (480, [(1, 168), (1, 48), (1, 432)]),
    ],
    ids=str,
)
def test_a_plain_car_takes_fine_steps_while_it_settles_and_starts(
    rate: float, steps: list[tuple[int, int]]
) -> None:
    """Steps of the settling, of the first 0.1 s and of the rest of 1 s, with their divisions."""
    taken: list[int] = []

    class CountedWorld(AlteredWorld):
        def step(self, divisions: int = 1, *_ahead: object) -> None:
            taken.append(divisions)
            self.world.step(divisions)

    engine = AlteredEngine(CountedWorld)
    rollout = simulate(CAR, get_task("movement", {"window": 1}), rate=rate, engine=engine)
    engine.close()
    assert rollout.sim_seconds == 1.0
    assert taken == [divisions for divisions, n in steps for _ in range(divisions * n)]
