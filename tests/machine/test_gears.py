"""Gear trains: which cogs mesh, how fast they turn, and which are locked."""

from __future__ import annotations

import pytest

from agentflow.machine.blocks.types import Plate
from agentflow.machine.geometry.gears import GearTrain, Meshing, gear_trains, meshing_pairs
from agentflow.machine.geometry.placement import place
from agentflow.machine.tree import Machine, Step

PLATE = Plate(15)
POWERED, MEDIUM, LARGE = 39, 38, 51


def cogs(*places: tuple[int, float, float]) -> Machine:
    steps = [Step(0, PLATE.type, -1, -1)]
    for kind, x, z in places:
        steps.append(Step(len(steps), kind, 0, PLATE.face(x, z)))
    return Machine(tuple(steps))


def pairs(machine: Machine) -> tuple[Meshing, ...]:
    return meshing_pairs(place(machine).blocks, 0.1)


@pytest.mark.parametrize(
    ("kind", "apart", "ratio"), [(MEDIUM, 2.0, 1.0), (LARGE, 3.5, 2.5), (POWERED, 2.0, 1.0)]
)
def test_cogs_mesh_where_their_pitch_circles_touch(kind: int, apart: float, ratio: float) -> None:
    assert pairs(cogs((POWERED, 0, 0), (kind, 0, apart))) == (Meshing(1, 2, ratio),)
    assert pairs(cogs((POWERED, 0, 0), (kind, 0, apart + 0.5))) == ()
    assert pairs(cogs((POWERED, 0, 0), (kind, 0.5, apart))) == (Meshing(1, 2, ratio),)
    assert pairs(cogs((POWERED, 0, 0), (kind, 1.0, apart))) == ()


def test_cogs_above_each_other_do_not_mesh() -> None:
    stacked = cogs((POWERED, 0, 0))
    assert pairs(Machine((*stacked, Step(2, MEDIUM, 1, 0)))) == ()


def test_meshing_cogs_turn_in_alternating_directions() -> None:
    machine = cogs((POWERED, 0, -4), (MEDIUM, 0, 4), (MEDIUM, 0, -2), (LARGE, 0, 1.5))
    assert gear_trains((1, 2, 3, 4), pairs(machine)) == (
        GearTrain({1: 1.0, 3: -1.0, 4: 0.4}, locked=False),
        GearTrain({2: 1.0}, locked=False),
    )


def test_a_loop_with_contradicting_speeds_is_locked() -> None:
    ring = (Meshing(1, 2, 1.0), Meshing(2, 3, 1.0), Meshing(1, 3, 1.0))
    assert gear_trains((1, 2, 3), ring) == (GearTrain({1: 0.0, 2: 0.0, 3: 0.0}, locked=True),)
    uneven = (
        Meshing(1, 2, 1.0),
        Meshing(2, 3, 1.0),
        Meshing(3, 4, 1.0),
        Meshing(1, 4, 1.1),
    )
    assert gear_trains((1, 2, 3, 4), uneven) == (
        GearTrain(dict.fromkeys((1, 2, 3, 4), 0.0), locked=True),
    )
    square = (
        Meshing(1, 2, 1.0),
        Meshing(2, 3, 1.0),
        Meshing(3, 4, 1.0),
        Meshing(1, 4, 1.0),
    )
    assert gear_trains((1, 2, 3, 4), square) == (
        GearTrain({1: 1.0, 2: -1.0, 3: 1.0, 4: -1.0}, locked=False),
    )


def test_rounding_does_not_lock_a_loop() -> None:
    ring = (
        Meshing(1, 2, 1.1),
        Meshing(2, 3, 1.1),
        Meshing(3, 4, 1.1),
        Meshing(1, 4, 1.1**3),
    )
    (train,) = gear_trains((1, 2, 3, 4), ring)
    assert not train.locked
    assert train.speeds == pytest.approx({1: 1.0, 2: -1 / 1.1, 3: 1 / 1.21, 4: -1 / 1.331})
