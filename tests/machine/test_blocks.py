import json
from dataclasses import replace
from pathlib import Path

import pytest

import agentflow.machine.blocks
from agentflow.errors import UnknownNameError
from agentflow.machine.blocks.library import LATER, Library, library, load_library
from agentflow.machine.blocks.types import Blade, Face, JointType

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


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"size_xyz": None}, "block type 63: wrong or missing field"),
        ({"mass": 0}, r"block type 63 \(Log\): mass must be positive"),
        ({"faces": [{"id": 1, "position": [0, 0, 0], "direction": "Up"}]}, "face ids must be"),
        (
            {"faces": [{"id": 0, "position": [0, 0, 0], "direction": "Top"}]},
            "face directions must be",
        ),
        ({"flags": ["nonstatic"]}, "unknown flag nonstatic"),
        ({"shape": "cone"}, "shape is 'cone'; expected one of box, cylinder, sphere, hinge"),
        ({"joint": {"kind": "screw"}}, "joint kind is 'screw'; expected one of fixed, revolute"),
        ({"joint": {"axis": "Top"}}, "joint axis is 'Top'; expected one of Front, Back"),
        ({"connector": "rod"}, "two-ended blocks must have no size, and all others must have one"),
        ({"category": "Tool"}, "block type 63: wrong or missing field 'Tool'"),
        ({"tooth": 3}, "block type 63: wrong or missing field .*tooth"),
        ({"counterpart": 1}, "block types 63 and 1: counterparts must name each other"),
    ],
)
def test_a_wrong_entry_is_refused(change: dict[str, object], message: str) -> None:
    entry = next(entry for entry in DOCUMENT["blocks"] if entry["type"] == 63)
    with pytest.raises(ValueError, match=message):
        load_library({**DOCUMENT, "blocks": [{**entry, **change}]})


def test_a_type_defined_twice_is_refused() -> None:
    with pytest.raises(ValueError, match="block type 0 is defined twice"):
        load_library({**DOCUMENT, "blocks": DOCUMENT["blocks"][:1] * 2})


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
