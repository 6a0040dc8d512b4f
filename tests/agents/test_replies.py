"""Machines in replies, in both notations."""

from __future__ import annotations

import json

import pytest

from agentflow.agents.designer import Designer, DesignerInput
from agentflow.agents.refiner import Refiner, RefinerInput
from agentflow.agents.replies import Representation, machine_items, machine_text, read_reply
from tests.agents.fakes import FRAME, PLAN, THROWER, THROWING, machine

BOTH = pytest.mark.parametrize("representation", ["tree", "coordinates"])


@BOTH
def test_what_is_shown_can_be_read_back(representation: Representation) -> None:
    text = f"So:\n```json\n{machine_text(THROWER, representation)}\n```"
    report = read_reply(text, THROWING, representation)
    assert (report.machine, report.task_valid, report.repaired) == (THROWER, True, False)
    assert json.loads(machine_text(FRAME, representation)) == list(
        machine_items(FRAME, representation)
    )


def test_the_tree_is_written_as_ever() -> None:
    assert machine_text(FRAME, "tree") == FRAME.to_text()


def test_given_connections_are_kept_where_coordinates_leave_a_choice() -> None:
    """A ring: the last block of the frame meets two faces; it stays on the one it was given."""
    ring = machine((15, 0, 0), (15, 1, 1), (15, 0, 2), (15, 3, 2))
    other = machine((15, 0, 0), (15, 1, 1), (15, 0, 2))
    longer = machine((15, 0, 0), (15, 1, 1), (15, 0, 2), (63, 0, 4))
    text = machine_text(longer, "coordinates")
    assert read_reply(text, THROWING, "coordinates", other).machine == longer
    assert ring != other


@BOTH
def test_a_designer_may_not_alter_what_is_given(representation: Representation) -> None:
    given = DesignerInput(THROWING, PLAN, "Base", FRAME, representation=representation)
    more = machine((1, 0, 0), (1, 0, 1), (15, 0, 4))
    good = Designer().parse(machine_text(more, representation), given)
    assert good.output is not None
    assert good.output.machine == more
    bad = Designer().parse(
        machine_text(machine((1, 0, 0), (1, 0, 2), (15, 0, 4)), representation), given
    )
    item = json.dumps(machine_items(FRAME, representation)[2])
    assert bad.code == "given_altered"
    assert bad.problem.startswith(f"Block 2 of the current machine, {item}, was changed to ")


@BOTH
def test_a_refiner_may_send_a_whole_machine(representation: Representation) -> None:
    given = RefinerInput(THROWING, THROWER, format="whole_machine", representation=representation)
    longer = machine(*((s.type, s.parent, s.face_id) for s in THROWER.steps[1:]), (15, 1, 0))
    text = f"<Modification Steps>{machine_text(longer, representation)}</Modification Steps>"
    parsed = Refiner().parse(text, given)
    assert parsed.output is not None, parsed.problem
    assert parsed.output.machine == longer


def test_a_block_that_hangs_on_nothing_is_spatially_invalid() -> None:
    items = list(machine_items(FRAME, "coordinates"))
    items[2] = {"type": 1, "Position": [0, 5, 0], "Rotation": [0, 0, 0, 1]}
    parsed = Designer().parse(
        json.dumps(items), DesignerInput(THROWING, representation="coordinates")
    )
    assert (parsed.output, parsed.parsed, parsed.spatial) == (None, True, False)
    nothing = Designer().parse("no", DesignerInput(THROWING, representation="coordinates"))
    assert (nothing.output, nothing.parsed, nothing.spatial) == (None, False, None)
