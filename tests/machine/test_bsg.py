from xml.etree.ElementTree import Element, fromstring

import pytest
from hypothesis import given

from agentflow.machine import Machine, check, library
from agentflow.machine.formats.bsg_reading import read_bsg
from agentflow.machine.formats.bsg_writing import to_bsg
from tests.machine.builders import CAR, CATAPULT, build
from tests.machine.strategies import machines

SPRUNG = build((1, 0, 4), (9, 0, 0, 1, 0), (7, 0, 1, 1, 3), (22, 0, 2), (35, 0, 3))
EXTENDED = build((39, 0, 0), (45, 0, 2, 0, 3), (26, 0, 4), (4, 0, 5), (14, 0, 1))


def blocks(machine: Machine) -> list[Element]:
    return fromstring(to_bsg(machine)).findall("./Blocks/Block")


def settings(block: Element) -> dict[str, tuple[str, object]]:
    data = block.find("Data")
    assert data is not None
    return {
        str(item.get("key")): (item.tag, [child.text for child in item] or item.text)
        for item in data
    }


def test_the_file_as_a_whole() -> None:
    root = fromstring(to_bsg(CAR))
    assert (root.tag, root.get("version"), root.get("bsgVersion")) == ("Machine", "1", "1.3")
    place = root.find("./Global/Position")
    turn = root.find("./Global/Rotation")
    assert place is not None
    assert turn is not None
    # the car's boxes reach from y = -1 to 1, and are centred on its root
    assert place.attrib == {"x": "0", "y": "1.5", "z": "0"}
    assert turn.attrib == {"x": "0", "y": "0", "z": "0", "w": "1"}
    assert [block.get("id") for block in root.findall("./Blocks/Block")] == list("0112222")


def test_the_boxes_are_centred_over_the_origin() -> None:
    place = fromstring(to_bsg(build((63, 0, 3), (15, 0, 0)))).find("./Global/Position")
    assert place is not None
    assert place.attrib == {"x": "-1.5", "y": "1", "z": "-0.5"}


def test_a_block_in_the_file() -> None:
    wheel = blocks(CAR)[3]
    values = {item.tag: item.attrib for item in wheel.findall("./Transform/*")}
    assert values == {
        "Position": {"x": "-0.5", "y": "0", "z": "1"},
        "Rotation": {"x": "0", "y": "-0.707106781", "z": "0", "w": "0.707106781"},
        "Scale": {"x": "1", "y": "1", "z": "1"},
    }


def test_settings_are_those_of_the_game() -> None:
    wheel = {"bmt-automatic": ("Boolean", "True"), "bmt-auto-brake": ("Boolean", "False")}
    root, _, _, left, right, *_ = blocks(CAR)
    assert settings(root) == {"bmt-version": ("Integer", "1")}
    assert settings(left) == {**wheel, "flipped": ("Boolean", "True")}
    assert settings(right) == wheel
    _, wood, spring, brace, rotating, ballast = blocks(SPRUNG)
    assert settings(wood) == {}
    zero = ("Vector3", ["0", "0", "0"])
    assert settings(spring) == {
        "bmt-slider": ("Single", "10"),
        "bmt-toggle": ("Boolean", "False"),
        "bmt-contract": ("StringArray", ["L"]),
        "start-position": zero,
        "end-position": ("Vector3", ["0", "2.5", "-0.5"]),
        "end-rotation": zero,
    }
    assert settings(brace) == {
        "start-position": zero,
        "end-position": ("Vector3", ["0.5", "1", "0.5"]),
        "end-rotation": zero,
    }
    assert settings(rotating) == {
        "bmt-version": ("Integer", "1"),
        "bmt-speed": ("Single", "1"),
        "bmt-acceleration": ("Single", "Infinity"),
        "bmt-auto-brake": ("Boolean", "True"),
        "flipped": ("Boolean", "False"),
    }
    assert settings(ballast) == {"bmt-mass": ("Single", "3")}


def test_the_same_machine_is_the_same_file() -> None:
    again = Machine(tuple(CATAPULT.steps))
    assert to_bsg(CATAPULT) == to_bsg(again)
    guids = [block.get("guid") for machine in (CATAPULT, CAR) for block in blocks(machine)]
    assert len(set(guids)) == len(CATAPULT) + len(CAR)


@pytest.mark.parametrize("machine", [CAR, CATAPULT, SPRUNG, EXTENDED])
def test_round_trip(machine: Machine) -> None:
    located = read_bsg(to_bsg(machine), tuple(library()))
    assert (located.machine, located.problems, located.loose, located.notes) == (
        machine,
        (),
        (),
        (),
    )


@given(machines())
def test_round_trip_is_exact_or_reports_ambiguous_parents(machine: Machine) -> None:
    located = read_bsg(to_bsg(machine))
    assert (located.problems, located.loose) == ((), ())
    assert located.machine == machine or any("ambiguous" in note for note in located.notes)


def block(
    kind: object,
    position: str,
    rotation: str = "0 0 0 1",
    scale: str = "1 1 1",
    data: str = "<Data/>",
) -> str:
    def attributes(values: str) -> str:
        return " ".join(
            f'{name}="{value}"' for name, value in zip("xyzw", values.split(), strict=False)
        )

    return (
        f'<Block id="{kind}" guid="g{kind}"><Transform><Position {attributes(position)}/>'
        f"<Rotation {attributes(rotation)}/><Scale {attributes(scale)}/></Transform>{data}</Block>"
    )


def file(*entries: str) -> str:
    return (
        '<?xml version="1.0" encoding="utf-8"?>\n<!--Besiege machine save file.-->\n'
        '<Machine version="1" bsgVersion="1.3" name="mine"><Global><Position x="0" y="5" z="0"/>'
        '<Rotation x="0" y="0" z="0" w="1"/></Global><Data><StringArray key="requiredMods"/></Data>'
        f"<Blocks>{''.join(entries)}</Blocks></Machine>"
    )


ROOT = block(0, "0 0 0")
PLAYERS = file(
    ROOT,
    block(15, "0 0 0.5"),
    block(57, "0 0 1.5"),
    block(1, "0 0 1.5", scale="1 1 2"),
    block(15, "0 0.5 0", rotation="0 0.38 0 0.92"),
    block(15, "0 0.5 1", rotation="-0.70710678 0 0 0.70710678"),
    block(15, "0 1.5 0"),
    block("x", "0 0 0"),
    block(2, "-0.5 0 0", rotation="0 -0.70710678 0 0.70710678"),
)


def test_unsupported_blocks_of_players_machines_are_skipped() -> None:
    located = read_bsg(PLAYERS)
    assert located.machine == build((15, 0, 0), (15, 1, 3), (2, 0, 2))
    assert [(problem.code, problem.blocks) for problem in located.problems] == [
        ("unknown_type", (2,)),
        ("not_a_number", (7,)),
    ]
    assert located.problems[0].message == (
        "block 2 of the file (id '57', guid 'g57'): type 57 is unknown; the nearest types are "
        "56 (Water Cannon), 55 (Small Propeller), 60 (Large Unpowered Wheel)"
    )
    assert [(problem.code, problem.message) for problem in located.loose] == [
        (
            "scale",
            "block 3 of the file (id '1', guid 'g1'): it is scaled to 1 x 1 x 2; blocks cannot "
            "be scaled here",
        ),
        (
            "rotation",
            "block 4 (Small Wooden Block) has rotation 0, 0.38, 0, 0.92, which is not within 1 "
            "degree of any of the six orientations",
        ),
        (
            "no_parent",
            "block 6 (Small Wooden Block) has no parent at (0, 1.5, 0): no earlier block has a "
            "face within 0.1 m that faces z+; the nearest such face is 0 of block 0 "
            "(Starting Block) at (0, 0, 0.5)",
        ),
    ]
    assert located.notes == (
        "block 8 of the file (id '2', guid 'g2'): its 'flipped' setting was "
        "ignored; here a wheel's facing determines its direction",
    )
    report = check(located)
    assert (report.file_valid, report.machine) == (False, None)
    assert len(report.problems) == 5


def test_unattached_blocks_are_spatially_invalid() -> None:
    report = check(read_bsg(file(ROOT, block(15, "0 0 9"))))
    assert (report.file_valid, report.spatial_valid) == (True, False)


def test_the_starting_block_may_be_anywhere_in_the_file() -> None:
    located = read_bsg(file(block(15, "1 1 1.5"), block(0, "1 1 1")))
    assert located.machine == build((15, 0, 0))
    second = read_bsg(file(ROOT, ROOT))
    assert [problem.code for problem in second.problems] == ["starting_block"]


def test_ends_turn_with_their_block() -> None:
    reach = '<Data><Vector3 key="end-position"><X>{}</X><Y>{}</Y><Z>{}</Z></Vector3></Data>'
    tower = block(1, "0 0.5 0", rotation="-0.70710678 0 0 0.70710678")
    straight = block(7, "0 0 0.5", data=reach.format(0, 1, 0))
    # turned by 90 degrees about x its own y is z-, its own z is y+
    turned = block(7, "0 0 0.5", "-0.70710678 0 0 0.70710678", data=reach.format(0, 0, 1))
    for brace in (straight, turned):
        located = read_bsg(file(ROOT, tower, brace))
        assert located.machine == build((1, 0, 4), (7, 0, 0, 1, 7))
    missing = read_bsg(file(ROOT, block(7, "0 0 0.5")))
    assert missing.problems[0].message == (
        "block 1 of the file (id '7', guid 'g7'): it has no end-position"
    )


HOSTILE = [
    ("", "not_xml", "this is not well-formed XML: no element found: line 1, column 0"),
    ("<a>", "not_xml", "this is not well-formed XML: no element found: line 1, column 3"),
    ("<a>&b;</a>", "not_xml", "this is not well-formed XML: undefined entity: line 1, column 3"),
    ("<a>\ud800</a>", "not_xml", "this is not well-formed XML: it contains lone surrogates"),
    ("<a>" * 65, "not_xml", "the XML is nested more than 64 levels deep"),
    ("<a/>", "not_a_machine", "this is not a Besiege machine file: it has no Machine element"),
    ("<Machine/>", "not_a_machine", "this is not a Besiege machine file: it has no Machine "),
    (file(block(1, "0 0 0")), "root", "the file has no Starting Block, id 0"),
    (
        file(block(0, "0 nan 0"), block(1, "0 0 1e308")),
        "not_a_number",
        "block 1 of the file (id '1', guid 'g1'): z of its Position is '1e308', expected a number "
        "of at most 1,000,000",
    ),
    (
        file(block(0, "0 0 0", scale="1 1 2")),
        "scale",
        "block 0 of the file (id '0', guid 'g0'): it is scaled to 1 x 1 x 2; blocks cannot "
        "be scaled here",
    ),
    (file(*[ROOT] * 801), "too_many_blocks", "the machine has 801 blocks; the maximum is 800"),
]


@pytest.mark.parametrize(("text", "code", "message"), HOSTILE, ids=range(len(HOSTILE)))
def test_invalid_machine_files(text: str, code: str, message: str) -> None:
    located = read_bsg(text)
    assert located.machine is None
    assert located.problems[-1].code == code
    assert located.problems[-1].message.startswith(message)


BOMBS = [
    '<!DOCTYPE a [<!ENTITY b "lol"><!ENTITY c "&b;&b;&b;&b;">]><Machine>&c;</Machine>',
    '<!DOCTYPE a [<!ENTITY b SYSTEM "file:///etc/hostname">]><Machine>&b;</Machine>',
    '<!DOCTYPE Machine SYSTEM "http://127.0.0.1/x.dtd"><Machine/>',
    '<!DOCTYPE a [<!ENTITY % b SYSTEM "file:///etc/hostname">%b;]><Machine/>',
]


@pytest.mark.parametrize("text", BOMBS)
def test_document_types_and_entities_are_refused(text: str) -> None:
    located = read_bsg('<?xml version="1.0"?>' + text)
    assert [problem.message for problem in located.problems] == [
        "the XML declares a document type, which is not allowed"
    ]
