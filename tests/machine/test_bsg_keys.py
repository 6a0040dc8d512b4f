"""Control programs as keys of the game."""

from __future__ import annotations

from dataclasses import replace

from agentflow.machine import library
from agentflow.machine.controls import Lane, lanes
from agentflow.machine.formats.bsg_writing import NO_KEY, bind_keys, to_bsg
from agentflow.machine.tree import Control
from tests.machine.builders import CAR, build
from tests.machine.test_bsg import blocks, settings
from tests.machine.test_control_edits import DRIVEN


def test_blocks_that_are_driven_alike_share_a_lane() -> None:
    assert lanes(DRIVEN) == (
        Lane((3, 5), 0.0, ((0.0, 5.0, 1.0),)),
        Lane((4, 6), 0.0, ((0.0, 0.5, 1.0), (0.5, 2.5, -1.0), (2.5, 5.0, 1.0))),
    )
    assert lanes(CAR) == ()


def test_each_lane_gets_a_key_per_direction() -> None:
    found = {number: settings(block) for number, block in enumerate(blocks(DRIVEN))}
    for number, forward, backward in ((3, "Alpha1", NO_KEY), (4, "Alpha2", "Alpha3")):
        assert found[number]["bmt-forward"] == ("StringArray", [forward])
        assert found[number]["bmt-backward"] == ("StringArray", [backward])
        assert found[number]["bmt-automatic"] == ("Boolean", "False")
    assert [str(binding) for binding in bind_keys(DRIVEN)] == [
        "the game has no control programs: for blocks 3, 5 hold Alpha1 from 0 to 5 s",
        "the game has no control programs: for blocks 4, 6 hold Alpha2 from 0 to 0.5 s and from "
        "2.5 to 5 s; Alpha3 from 0.5 to 2.5 s",
    ]


def test_a_key_is_held_while_only_the_level_changes() -> None:
    program = (Control("motors", 0.0, 3.0, 1.0), Control("motors", 1.0, 1.0, 0.2))
    (binding,) = bind_keys(replace(CAR, controls=program))
    assert binding.held == (((0.0, 3.0),), ())


def test_grabbers_have_a_key_that_opens_them_and_springs_keep_their_setting() -> None:
    machine = build((27, 0, 0), (9, 0, 4, 1, 0), (28, 0, 1))
    program = (Control((1,), 1.0, 1.0, 0.0), Control((2,), 0.5, 1.0, 1.0))
    _, grabber, spring, hinge = blocks(replace(machine, controls=program))
    assert settings(grabber)["bmt-detach"] == ("StringArray", ["Alpha1"])
    assert settings(spring)["bmt-contract"] == ("StringArray", ["Alpha2"])
    assert settings(spring)["bmt-slider"] == ("Single", "10")
    assert settings(hinge)["bmt-left"] == ("StringArray", [NO_KEY])  # no entry drives it


def test_every_driven_type_has_keys() -> None:
    for block in library().values():
        assert bool(block.keys) == (block.group is not None), block.label


def test_machines_without_a_program_start_by_themselves() -> None:
    assert bind_keys(CAR) == ()
    assert "bmt-forward" not in to_bsg(CAR)
