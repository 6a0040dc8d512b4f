"""Rotating a whole machine changes nothing where the orientation rules allow it."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agentflow.machine import ROOT, Geometry, Machine, Step, library, place
from agentflow.machine.blocks.types import DIRECTIONS
from agentflow.machine.geometry.pose import FACINGS, Facing, Units3
from tests.machine.builders import CAR, build
from tests.machine.strategies import machines

ROOT_FACE = {tuple(DIRECTIONS[face.direction]): face.id for face in library()[0].faces}


def turned(machine: Machine, by: Facing) -> Machine:
    """The machine with every block on the root moved to the face given by a rotation."""
    faces = library()[0].faces

    def end(parent: int, face: int) -> int:
        return ROOT_FACE[by.turn(DIRECTIONS[faces[face].direction])] if parent == 0 else face

    steps = [ROOT]
    for step in machine.steps[1:]:
        second = (
            () if step.parent_b is None else (step.parent_b, end(step.parent_b, step.face_id_b))
        )  # type: ignore[arg-type]
        steps.append(Step(step.id, step.type, step.parent, end(step.parent, step.face_id), *second))
    return Machine(tuple(steps))


def box(by: Facing, lo: Units3, hi: Units3) -> tuple[Units3, Units3]:
    a, b = by.turn(lo), by.turn(hi)
    low, high = (tuple(pick(u, v) for u, v in zip(a, b, strict=True)) for pick in (min, max))
    return low, high  # type: ignore[return-value]


def legal(machine: Machine, by: Facing) -> bool:
    """Whether the orientation rules turn every block as the rotation does, including roll."""
    before, after = place(machine), place(turned(machine, by))
    return all(
        (new.orientation.front, new.orientation.right)
        == (by.turn(old.orientation.front), by.turn(old.orientation.right))
        for old, new in zip(before.blocks[1:], after.blocks[1:], strict=True)
        if not old.two_ended
    )


def same_but_turned(machine: Machine, by: Facing) -> None:
    before, after = place(machine), place(turned(machine, by))
    assert after.overlaps == before.overlaps
    for old, new in zip(before.blocks, after.blocks, strict=True):
        assert (new.lo, new.hi) == box(by, old.lo, old.hi)
    # except loops that close at the root, because its own front does not rotate
    assert loops(after) == loops(before)


def loops(geometry: Geometry) -> set[frozenset[int]]:
    pairs = (frozenset((loop.block, loop.partner)) for loop in geometry.auto_connections)
    return {pair for pair in pairs if 0 not in pair}


@st.composite
def level_machines(draw: st.DrawFn) -> Machine:
    """Machines without a block that faces up or down; often with overlaps."""
    steps = [ROOT]
    kinds = [kind for kind in library().core if kind and library()[kind].size]
    for index in range(1, draw(st.integers(2, 12))):
        ends = [
            (placed.id, face.face_id)
            for placed in place(Machine(tuple(steps))).blocks
            for face in placed.faces
            if face.facing[0] != "y"
        ]
        steps.append(Step(index, draw(st.sampled_from(kinds)), *draw(st.sampled_from(ends))))
    return Machine(tuple(steps))


@pytest.mark.parametrize("facing", ["z+", "z-", "x+", "x-"])
@given(machine=level_machines())
@pytest.mark.slow
def test_level_machines_turn_about_the_vertical(facing: str, machine: Machine) -> None:
    assert legal(machine, FACINGS[facing])
    same_but_turned(machine, FACINGS[facing])


@given(machine=machines(), by=st.sampled_from(tuple(FACINGS.values())))
def test_machines_turn_wherever_that_is_legal(machine: Machine, by: Facing) -> None:
    if legal(machine, by):
        same_but_turned(machine, by)


def test_what_may_stand_up_and_what_may_not() -> None:
    rod = build((63, 0, 0), (36, 1, 0), (36, 1, 0), (9, 1, 0, 0, 4))
    for name in ("y+", "y-"):
        assert legal(rod, FACINGS[name])
        same_but_turned(rod, FACINGS[name])
        assert not legal(CAR, FACINGS[name])
    assert not legal(build((15, 0, 4)), FACINGS["x+"])
