"""Pegs go into their holes, with a gap all around, along the way on which blocks are put on."""

from __future__ import annotations

from itertools import combinations
from math import pi
from typing import Any

import numpy as np
import pytest

from agentflow.env.physics.frames import swap
from agentflow.errors import UsageError
from agentflow.machine import Geometry, Machine, library, place
from agentflow.machine.geometry.pieces import build_order
from tests.machine.builders import CAR, CATAPULT, build

pytestmark = [pytest.mark.cad, pytest.mark.slow]

SCALE, PEG = 50.0, 5.0
"""mm per m: 1 : 20; and mm."""
ON_EACH = [
    build((kind, 0, 0), (15, 1, 0)) if library()[kind].faces else build((kind, 0, 0))
    for kind in library()
    if not library()[kind].root and not library()[kind].linear
]
"""Every type on the root, with a block on its first face where it has one."""


def bodies_of(machine: Machine) -> tuple[Geometry, dict[int, Any], dict[int, Any]]:
    """The geometry, and the bodies without and with pegs."""
    from agentflow.making.parts import parts_of
    from agentflow.making.printing import body, with_pegs

    plain = {part.block: body(part, SCALE) for part in parts_of(machine) if not part.kind.linear}
    geometry = place(machine)
    return geometry, plain, with_pegs(plain, geometry, SCALE, PEG)


@pytest.mark.parametrize("machine", [CAR, CATAPULT, *ON_EACH], ids=lambda m: m.digest[:6])
def test_pegs_fit_their_holes(machine: Machine) -> None:
    geometry, plain, made = bodies_of(machine)
    pegged = [
        placed
        for placed in geometry.blocks
        if placed.step.parents
        and not placed.two_ended
        and library()[placed.type].joint.kind != "loose"
    ]
    for one, other in combinations(made.values(), 2):
        assert (one ^ other).volume() < 1e-6, "no peg touches the rim or the ground of its hole"
    holes = dict.fromkeys(made, 0)
    for placed in pegged:
        holes[placed.step.parent] += 1
    pin, hole = pi * PEG**2 / 4 * PEG, pi * 5.2**2 / 4 * 5.2
    for placed in geometry.blocks:
        if placed.id not in made or library()[placed.type].shape == "caster":  # trimmed a little
            continue
        grown = made[placed.id].volume() - plain[placed.id].volume()
        wanted = pin * (placed in pegged) - hole * holes[placed.id]
        assert grown == pytest.approx(wanted, abs=0.04 * hole * (1 + holes[placed.id]))
    for placed in pegged:
        parent = made[placed.step.parent]
        reach = np.array(swap(placed.front))
        half = made[placed.id].translate(PEG / 2 * reach)
        assert (half ^ parent).volume() < 1e-6, "it slides out along its front"
        aside = made[placed.id].translate(np.roll(reach, 1) * 0.5)
        assert (aside ^ parent).volume() > 0.1, "it holds sideways"


def test_a_machine_is_put_together_in_its_order() -> None:
    """Each part with its peg slides in past those before it, half a peg at a time."""
    geometry, _, made = bodies_of(CATAPULT)
    order = build_order(geometry)
    assert isinstance(order, tuple)
    for index, block in enumerate(order[1:], 1):
        for away in np.arange(0.0, 12 * PEG, PEG / 2):
            moved = made[block].translate(away * np.array(swap(geometry[block].front)))
            for other in order[:index]:
                box, held = library()[geometry[other].type], geometry[block].step.parent == other
                if not (held and box.shape == "container"):
                    assert (moved ^ made[other]).volume() < 1e-6


def test_a_peg_thicker_than_a_face_is_refused() -> None:
    from agentflow.making.parts import parts_of
    from agentflow.making.printing import body, with_pegs

    machine = build((55, 0, 0))
    bodies = {part.block: body(part, SCALE) for part in parts_of(machine)}
    with pytest.raises(UsageError) as error:
        with_pegs(bodies, place(machine), SCALE, 20.0)
    assert str(error.value) == (
        "pegs of 20 mm are too thick where block 1 (Small Propeller) joins block 0 (Starting "
        "Block): take thinner pegs or make the machine larger"
    )
