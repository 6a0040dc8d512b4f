"""Earlier edits in the numbering of the current machine."""

from __future__ import annotations

from hypothesis import given

from agentflow.machine import Machine, apply_script, place
from agentflow.machine.edits.commands import command_text, read_command
from agentflow.machine.edits.difference import (
    Renumbering,
    follow,
    matching_ids,
    renumber,
    renumbering,
)
from tests.machine.builders import build
from tests.machine.strategies import valid_machines

FRAME = build((1, 0, 0), (15, 0, 1), (2, 1, 1), (9, 0, 4, 1, 5))


def edit(machine: Machine, script: str) -> tuple[Machine, Renumbering]:
    outcome = apply_script(machine, script)
    assert outcome.success
    return outcome.machine, renumbering(machine, outcome.id_map, outcome.names)


def renumbered(line: str, ids: Renumbering) -> str:
    command = read_command(line)
    assert command is not None
    return "".join(map(str, renumber(command_text(command), ids)))


def test_ids_of_then_are_ids_of_now() -> None:
    script = "Remove 2\nAdd 63 to 1 in 0 as axle\nAdd 2 to axle in 3"
    _, ids = edit(FRAME, script)
    assert [renumbered(line, ids) for line in script.splitlines()] == [
        "Remove Small Wooden Block (gone from 0 in 1)",
        "Add 63 to 1 in 0 as 4",
        "Add 2 to 4 in 3",
    ]
    assert renumbered("Move 3 to 1 in 3", ids) == "Move 2 to 1 in 3"
    assert renumbered("Add 9 to 2 in 0 to 3 in 1", ids) == (
        "Add 9 to Small Wooden Block (gone from 0 in 1) in 0 to 2 in 1"
    )


def test_renumberings_add_up() -> None:
    second, first_ids = edit(FRAME, "Remove 2\nAdd 15 to 0 in 1 as tail")
    third, later_ids = edit(second, "Remove 3\nRemove 2\nAdd 15 to 4 in 0 as tail")
    assert third == build((1, 0, 0), (15, 0, 1), (15, 2, 0))
    ids = follow(first_ids, later_ids)
    assert renumbered("Add 15 to 0 in 1 as tail", ids) == "Add 15 to 0 in 1 as 2"
    assert renumbered("Remove 2", ids) == "Remove Small Wooden Block (gone from 0 in 1)"
    assert renumbered("Remove 4", ids) == "Remove Spring (gone from 0 in 4 and 1 in 5)"
    gone, last_ids = edit(third, "Remove 3\nRemove 2\nRemove 1")
    assert len(gone) == 1
    assert renumbered("Remove 4", follow(ids, last_ids)) == (
        "Remove Spring (gone from 0 in 4 and Wooden Block (gone from 0 in 0) in 5)"
    )


def test_names_of_a_later_edit_are_not_those_of_an_earlier_one() -> None:
    _, ids = edit(FRAME, "Add 15 to 0 in 5 as a")
    assert renumbered("Add 2 to a in 0", follow({}, ids)) == "Add 2 to a in 0"
    assert renumbered("Add 2 to a in 0", ids) == "Add 2 to 5 in 0"


def test_blocks_of_a_new_machine_are_known_by_type_and_place() -> None:
    new = build((15, 0, 1), (1, 0, 0), (9, 2, 5, 0, 4), (9, 0, 4, 2, 5))
    assert matching_ids(FRAME, new) == {0: 0, 1: 2, 2: 1, 3: None, 4: 4}


@given(valid_machines())
def test_every_block_is_itself_in_its_own_machine(machine: Machine) -> None:
    geometry = place(machine)
    for old, new in matching_ids(machine, machine).items():
        assert new is not None
        assert (geometry[new].at, geometry[new].far) == (geometry[old].at, geometry[old].far)
