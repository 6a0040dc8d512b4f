"""Exactly the joints that rigid connections bridge or other joints hold are reported as locked."""

from __future__ import annotations

from random import Random

import pytest

from agentflow.env.constants import constants
from agentflow.env.physics.assembly import assemble
from agentflow.env.physics.structure.spanning_tree import skeleton
from agentflow.machine.edits.random import random_machine
from agentflow.machine.geometry.pieces import locked_joints
from agentflow.machine.geometry.placement import place
from agentflow.machine.tree import Machine
from agentflow.machine.validity import check
from tests.env.machines import machine

HINGED = ((0, -1, -1), (5, 0, 0), (63, 1, 0))


def test_a_brace_across_a_hinge_locks_it() -> None:
    report = check(machine(*HINGED, (7, 0, 4, 2, 9)))
    assert report.machine_valid
    (warning,) = report.warnings
    assert warning.code == "locked"
    assert warning.blocks == (1, 3)
    assert warning.message == (
        "the moving joint of block 1 (Hinge) cannot move: block 3 (Brace) bridges it"
    )


def test_a_closed_frame_beside_a_hinge_locks_it() -> None:
    frame = machine(
        (0, -1, -1),
        (15, 0, 2),
        (15, 1, 0),
        (5, 0, 4),
        (15, 2, 3),
        (15, 3, 0),
        (15, 4, 0),
        (15, 5, 1),
    )
    (warning,) = check(frame).warnings
    assert warning.blocks == (3, 7)
    assert warning.message == (
        "the moving joint of block 3 (Hinge) cannot move: the front of block 7 (Small Wooden "
        "Block) also connects to block 6 (Small Wooden Block)"
    )


def test_two_hinges_side_by_side_lock_each_other() -> None:
    """Their axes are parallel, but not in one line, and a brace joins what hangs on them."""
    pair = check(machine((0, -1, -1), (5, 0, 3), (28, 0, 1), (7, 1, 0, 2, 0)))
    assert [(warning.code, warning.blocks, warning.message) for warning in pair.warnings] == [
        (
            "locked",
            (block,),
            f"the moving joint of block {block} ({name}) cannot move: other moving joints hold "
            "the same parts",
        )
        for block, name in ((1, "Hinge"), (2, "Steering Hinge"))
    ]


def test_a_decoupler_is_not_a_moving_joint() -> None:
    assert locked_joints(place(machine((0, -1, -1), (4, 0, 0), (63, 1, 0), (7, 0, 4, 1, 2)))) == []


def test_without_a_brace_or_with_a_spring_instead_it_moves() -> None:
    assert check(machine(*HINGED)).warnings == ()
    assert check(machine(*HINGED, (9, 0, 4, 2, 9))).warnings == ()


def test_invalid_input_has_no_warnings() -> None:
    assert check("no machine").warnings == ()


@pytest.mark.parametrize(
    "seed",
    [pytest.param(seed, marks=() if 3 <= seed < 13 else pytest.mark.slow) for seed in range(40)],
)
def test_warnings_agree_with_the_simulation(seed: int) -> None:
    """The fast tests use machines with and without such joints."""
    tree = random_machine(Random(seed), size=(12, 30))
    physics = assemble(tree, place(tree), constants())
    plan = skeleton(len(physics.parts), physics.joints)
    expected = {physics.joints[i].block for i in (*plan.locked, *plan.jammed)}
    assert _blamed(tree) == expected


def _blamed(tree: Machine) -> set[int]:
    """Blocks whose joints are reported as locked."""
    moving = (warning.message.split("block ")[1] for warning in locked_joints(place(tree)))
    return {int(text.split()[0]) for text in moving}
