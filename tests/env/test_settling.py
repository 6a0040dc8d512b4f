"""What counts as settled: rest and creep do, a fall that begins slowly does not."""

from __future__ import annotations

from collections.abc import Callable
from math import exp

import numpy as np
import pytest

from agentflow.env.constants import constants
from agentflow.env.physics.assembly import assemble
from agentflow.env.physics.engine import World
from agentflow.env.physics.engines import default_engine
from agentflow.env.rollout import Array
from agentflow.env.scene import Scene
from agentflow.env.simulation.settling import Settling
from agentflow.machine.geometry.placement import place
from agentflow.machine.tree import ROOT, Machine
from tests.env.fakes import AlteredWorld

RATE = 120.0
Path = Callable[[float], float]


class OnRails(AlteredWorld):
    """One block whose height is given for every moment."""

    now = 0.0

    def __init__(self, world: World, path: Path) -> None:
        super().__init__(world)
        self._path = path

    def centres(self) -> Array:
        return np.array([[0.0, self._path(self.now), 0.0]])


def settled(path: Path, slow: bool = True) -> float | None:
    """When it counts as settled, s; None if not within 3 s."""
    engine, tree = default_engine().start(), Machine((ROOT,))
    assembly = assemble(tree, place(tree), constants())
    world = OnRails(engine.build(assembly, Scene(), RATE), path)
    settling = Settling(tree, world, RATE, constants())
    found = None
    for step in range(1, 361):
        world.now = step / RATE
        if settling.step(slow):
            found = world.now
            break
    engine.close()
    return found


def test_what_rests_or_creeps_has_settled_and_what_rolls_out_is_watched_for_longer() -> None:
    assert settled(lambda _: 1.0) == pytest.approx(4 / 15)
    assert settled(lambda time: 1.0 - 0.01 * time) == pytest.approx(4 / 15)
    assert settled(lambda time: exp(-time)) == pytest.approx(11 / 15)


def test_what_is_too_fast_has_not_settled() -> None:
    assert settled(lambda _: 1.0, slow=False) is None


@pytest.mark.parametrize("speed", [1e-3, 0.01, 0.04])
def test_a_fall_that_begins_slowly_is_no_rest(speed: float) -> None:
    assert settled(lambda time: 1.0 - speed / 2 * exp(2 * time)) is None
