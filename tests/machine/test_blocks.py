import json
from dataclasses import asdict, replace
from pathlib import Path

import pytest
from pydantic import TypeAdapter

import agentflow.machine.blocks
from agentflow.errors import UnknownNameError
from agentflow.machine.blocks.library import LATER, Library, library
from agentflow.machine.blocks.types import DIRECTIONS, Blade, BlockType, Face, JointType

DOCUMENT = json.loads(
    Path(agentflow.machine.blocks.__file__).with_name("blocks.json").read_text(encoding="utf-8")
)


def test_the_library_holds_27_core_and_10_extended_types() -> None:
    assert len(library().core) == 27
    extended = (4, 14, 26, 38, 39, 45, 47, 51, 55, 56)
    assert tuple(sorted(library().keys() - library().core)) == extended
    assert list(library()) == sorted(library())


def test_a_log() -> None:
    log = library()[63]
    assert (log.name, log.size, log.mass) == ("Log", (1.0, 1.0, 3.0), 1.0)
    assert len(log.faces) == 13
    assert log.faces[6] == Face(6, (0.5, 0.0, 2.5), "Right")


def test_special_numbers() -> None:
    assert library()[5].joint == JointType("revolute", "Right", (-90.0, 90.0))
    assert library()[28].joint == JointType(
        "revolute", "Up", (-90.0, 90.0), switch="steering_hinges", motor_sense=-1
    )
    assert library()[14].thrust == 100.0
    assert library()[26].blade == Blade(23.07, 0.015, 30)
    assert library()[51].pitch_radius == 2.5
    assert library()[27].grip_direction == "Front"
    assert [kind for kind, block in library().items() if block.linear] == [7, 9, 45]
    assert [kind for kind, block in library().items() if block.powered_wheel] == [2, 46]


def test_lookup_by_name_or_id() -> None:
    assert library().find(63).type == 63
    assert library().find(" 63 ").type == 63
    assert library().find("large powered-wheel").type == 46


def test_an_unknown_type_names_the_nearest() -> None:
    with pytest.raises(UnknownNameError, match=r"^unknown block type '64'; known: 63 \(Log\), 60"):
        library().find(64)
    with pytest.raises(UnknownNameError, match=r"^unknown block type 'Logg'; known: Log, "):
        library().find("Logg")


def test_every_entry_is_whole_and_fits_the_others() -> None:
    listed = [entry["type"] for entry in DOCUMENT["blocks"]]
    assert len({*listed}) == len(listed)
    for kind, block in library().items():
        TypeAdapter(BlockType).validate_python(asdict(block))  # its words are known ones
        directions = (block.joint.axis, block.push, block.grip_direction or "Front")
        assert {*directions, *(face.direction for face in block.faces)} <= {*DIRECTIONS}, kind
        assert [face.id for face in block.faces] == [*range(len(block.faces))]
        assert block.joint.motor_sense in (1, -1)
        assert block.linear == (block.size is None)
        assert block.mass > 0
        assert block.counterpart is None or library()[block.counterpart].counterpart == kind


def test_the_digest_covers_physics_and_no_texts() -> None:
    wheel = library()[2]
    changes = {"mass": 9.0, "name": "Rim", "color": (0.0, 0.0, 0.0), "motor_name": "rims"}
    found = {
        name: Library({**library(), 2: replace(wheel, **{name: value})}).digest
        for name, value in changes.items()
    }
    assert [name for name in changes if found[name] != library().digest] == ["mass"]


def test_types_that_came_later_leave_the_digest_of_recorded_runs_alone() -> None:
    first = {kind: block for kind, block in library().items() if kind not in LATER}
    assert Library(first).digest == library().digest
    assert all(library()[kind].extended for kind in LATER)
