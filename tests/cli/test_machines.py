"""check, edit and convert as a user types them, in files and in streams."""

from __future__ import annotations

import gc
import io
import itertools
import json
import re
import tracemalloc
from pathlib import Path

import pytest

from agentflow.app.machines.edits import edit_line
from agentflow.app.machines.files import check, parse_line
from agentflow.cli import main
from agentflow.machine.formats.bsg_writing import to_bsg
from agentflow.machine.formats.coordinates import to_coordinates
from tests.machine.builders import CAR, CATAPULT, build

Captured = pytest.CaptureFixture[str]

TREE = json.dumps(CAR.to_json())
VALID = ["file_valid", "spatial_valid", "machine_valid", "repaired"]
KEYS = [*VALID, "problems", "overlaps", "size", "warnings"]
RECORDED = Path(__file__).parents[2] / "runs" / "recorded-throwing"
FOREIGN = to_bsg(CAR).replace('<Block id="1"', '<Block id="57"', 1)


@pytest.fixture(autouse=True)
def _files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("car.json").write_text(TREE)
    Path("car.coords.json").write_text(json.dumps(to_coordinates(CAR)))
    Path("car.bsg").write_text(to_bsg(CAR))
    Path("utf16.bsg").write_bytes(to_bsg(CAR).replace("utf-8", "utf-16").encode("utf-16"))
    Path("foreign.bsg").write_text(FOREIGN)


def out(capsys: Captured, *arguments: str) -> str:
    assert main(list(arguments)) == 0
    captured = capsys.readouterr()
    assert captured.err == ""
    return captured.out


def typed(monkeypatch: pytest.MonkeyPatch, text: str | bytes) -> None:
    data = text.encode() if isinstance(text, str) else text
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(data)))


@pytest.mark.parametrize("file", ["car.json", "car.coords.json", "car.bsg", "utf16.bsg"])
def test_check_takes_any_form(file: str, capsys: Captured) -> None:
    report = json.loads(out(capsys, "check", file, "--json", "--geometry"))
    assert list(report) == [*KEYS, "blocks"]
    assert report["machine_valid"]
    assert report["blocks"][3]["orientation"] == "x-"


def test_check_warns_of_joints_that_cannot_move(capsys: Captured) -> None:
    braced = build((5, 0, 0), (63, 1, 0), (7, 0, 4, 2, 9))
    Path("braced.json").write_text(json.dumps(braced.to_json()))
    told = out(capsys, "check", "braced.json")
    text = "the moving joint of block 1 (Hinge) cannot move: block 3 (Brace) bridges it"
    assert f"warning: {text}" in " ".join(told.split())
    assert "warning" not in out(capsys, "check", "car.json")
    report = json.loads(out(capsys, "check", "braced.json", "--json"))
    assert list(report) == KEYS
    assert [warning["code"] for warning in report["warnings"]] == ["locked"]


def test_check_warns_of_a_two_ended_block_without_length(capsys: Captured) -> None:
    point = build((15, 0, 4), (15, 0, 0), (15, 2, 3), (9, 1, 4, 3, 3))
    Path("point.json").write_text(point.to_text())
    told = " ".join(out(capsys, "check", "point.json").split())
    assert (
        "warning: block 4 (Spring) has no length: both its ends are at (0.0, 1.0, 0.5); attach "
        "it to faces at different places"
    ) in told


OVERLAPPING = build((15, 0, 0), (15, 0, 0))
STRICT = {
    "car.json": (TREE, 0),
    "overlap.json": (OVERLAPPING.to_text(), 1),
    "locked.json": (build((5, 0, 0), (63, 1, 0), (7, 0, 4, 2, 9)).to_text(), 1),
    "comma.json": (f"{TREE[:-1]},]", 1),
    "none.json": ("[{}]", 1),
}


@pytest.mark.parametrize("name", STRICT)
def test_a_strict_check_fails_on_problems_warnings_and_repairs(name: str, capsys: Captured) -> None:
    text, status = STRICT[name]
    Path(name).write_text(text)
    plain = out(capsys, "check", name)
    assert main(["check", name, "--strict"]) == status
    captured = capsys.readouterr()
    assert (captured.out, captured.err) == (plain, "")


def test_a_strict_check_sees_the_rules_of_the_task_and_every_line(
    monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    arguments = ["check", "car.json", "--strict"]
    assert [main(arguments), main([*arguments, "--task", "throwing"])] == [0, 1]
    capsys.readouterr()
    for lines, status in (([TREE, TREE], 0), ([json.dumps(OVERLAPPING.to_json()), TREE], 1)):
        typed(monkeypatch, "\n".join(lines) + "\n")
        assert main(["check", "-", "--jsonl", "--strict"]) == status
        assert len(capsys.readouterr().out.splitlines()) == 2


def test_check_with_a_given_form(capsys: Captured) -> None:
    for form, valid in (("coordinates", True), ("tree", False)):
        report = json.loads(out(capsys, "check", "car.coords.json", "--format", form, "--json"))
        assert report["machine_valid"] is valid
    report = json.loads(out(capsys, "check", "foreign.bsg", "--json"))
    assert [problem["code"] for problem in report["problems"]] == [
        "unknown_type",
        "no_parent",
        "no_parent",
    ]


def test_every_line_gets_a_report(monkeypatch: pytest.MonkeyPatch, capsys: Captured) -> None:
    lines = [
        TREE,
        "",
        "no machine",
        json.dumps(f"```json\n{TREE[:-1]},]\n```"),
        json.dumps(to_coordinates(CAR)),
        json.dumps(FOREIGN),
        '"\\ud800"',
        "[" * 5000,
        "17",
    ]
    typed(monkeypatch, "\n".join(lines).encode() + b"\n\xff\xfe\n" + TREE.encode())
    reports = [json.loads(line) for line in out(capsys, "check", "-", "--jsonl").splitlines()]
    assert [report["file_valid"] for report in reports] == [
        *(True, False, False, True, True, False),
        *(False, False, False, False, True),
    ]
    assert all(list(report) == KEYS for report in reports)
    assert [report["repaired"] for report in reports].index(True) == 3


@pytest.mark.slow
def test_reports_stream_in_constant_memory() -> None:
    endless = itertools.cycle([TREE, "no machine", json.dumps(CATAPULT.to_text())])
    reports = (check(parse_line(line), None, geometry=True) for line in endless)
    assert [next(reports)["file_valid"] for _ in range(6)] == [True, False, True] * 2
    tracemalloc.start()
    try:
        sizes = []
        for _ in range(3):
            for report in itertools.islice(reports, 120):
                del report
            gc.collect()
            sizes.append(tracemalloc.get_traced_memory()[0])
    finally:
        tracemalloc.stop()
    assert sizes[2] - sizes[1] < 20_000


def test_edit_a_file(capsys: Captured, monkeypatch: pytest.MonkeyPatch) -> None:
    Path("script").write_text("1. Remove [6]\n2. Add [35] to [0] in [4]\n")
    outcome = json.loads(out(capsys, "edit", "car.json", "--script", "script", "--json"))
    assert list(outcome) == ["outcome", "steps", "machine", "id_map"]
    assert outcome["outcome"] == "success"
    assert [list(step) for step in outcome["steps"]] == [["text", "verdict", "code", "reason"]] * 2
    assert outcome["machine"][6] == {"type": 35, "id": 6, "parent": 0, "face_id": 4}
    assert outcome["id_map"] == {**{str(i): i for i in range(6)}, "6": None}
    assert out(capsys, "edit", "car.bsg", "--script", "script").splitlines() == [
        "Success: 1. Remove [6]",
        "Success: 2. Add [35] to [0] in [4]",
        "success",
        json.dumps(outcome["machine"]),
    ]
    typed(monkeypatch, "Remove 0\nRemove 6\n")
    assert out(capsys, "edit", "car.json").splitlines() == [
        "Error: Remove 0",
        "  starting_block: block 0, the Starting Block, cannot be removed",
        "Unverified: Remove 6",
        "failure",
    ]


def test_an_edited_machine_is_written(capsys: Captured) -> None:
    Path("script").write_text("Remove 6")
    outcome = json.loads(
        out(capsys, "edit", "car.bsg", "--script", "script", "--out", "new.json", "--json")
    )
    assert json.loads(Path("new.json").read_text()) == outcome["machine"]
    Path("script").write_text("Remove 0")
    assert out(capsys, "edit", "new.json", "--script", "script", "--out", "other.json")
    assert not Path("other.json").exists()


def test_a_tasks_blocks_bind_edits(capsys: Captured) -> None:
    Path("script").write_text("Add 13 to 0 in 4")
    arguments = ("edit", "car.json", "--script", "script", "--json")
    assert json.loads(out(capsys, *arguments))["outcome"] == "success"
    outcome = json.loads(out(capsys, *arguments, "--task", "throwing"))
    assert (outcome["outcome"], outcome["steps"][0]["code"]) == ("failure", "type_not_allowed")


def test_every_line_gets_an_outcome() -> None:
    lines = [
        json.dumps({"machine": CAR.to_json(), "script": "Remove 6"}),
        json.dumps({"machine": CAR.to_json(), "script": "Remove 1"}),
        json.dumps({"machine": [1], "script": "Remove 1"}),
        json.dumps({"machine": CAR.to_json()}),
        "no JSON",
        "",
    ]
    outcomes = [edit_line(line, None) for line in lines]
    assert all(list(item) == ["outcome", "steps", "machine", "id_map"] for item in outcomes)
    assert [item["outcome"] for item in outcomes] == ["success"] + ["failure"] * 5
    assert [item["steps"][0]["code"] for item in outcomes] == [
        *("", "has_children"),
        *["bad_format"] * 4,
    ]
    assert outcomes[2]["machine"] == [1]
    assert outcomes[2]["steps"][0]["reason"] == (
        "the machine cannot be edited: item 0 of the machine's list is 1; expected an object "
        "with type, id, "
        "parent, face_id"
    )
    assert outcomes[4]["steps"][0]["reason"] == (
        'expected a JSON object like {"machine": [...], "script": "Remove 3"}'
    )


def test_edits_of_lines(monkeypatch: pytest.MonkeyPatch, capsys: Captured) -> None:
    typed(monkeypatch, json.dumps({"machine": CAR.to_text(), "script": "Remove 6\nbla"}) + "\nx\n")
    first, second = map(json.loads, out(capsys, "edit", "-", "--jsonl").splitlines())
    assert [step["verdict"] for step in first["steps"]] == ["Success", "Error"]
    assert first["machine"] == CAR.to_json()
    assert second["outcome"] == "failure"


@pytest.mark.parametrize("source", ["car.json", "car.coords.json", "car.bsg"])
@pytest.mark.parametrize("ending", [".json", ".coords.json", ".bsg", ".BSG"])
def test_conversion_is_exact(source: str, ending: str, capsys: Captured) -> None:
    assert out(capsys, "convert", source, f"made{ending}") == f"made{ending}: 7 blocks\n"
    assert json.loads(out(capsys, "convert", f"made{ending}", "back.json", "--json")) == {
        "out": "back.json",
        "blocks": 7,
        "left_out": [],
        "notes": [],
        "warnings": [],
    }
    assert json.loads(Path("back.json").read_text()) == CAR.to_json()


def test_an_invalid_machine_is_converted_with_a_warning(capsys: Captured) -> None:
    Path("bad.json").write_text(OVERLAPPING.to_text())
    told = " ".join(out(capsys, "convert", "bad.json", "bad.bsg").split())
    assert told.startswith(
        "warning: the machine is not valid: blocks 1, 2 share face 0 of block 0 (Starting Block); "
    )
    assert told.endswith(" (and 1 more) bad.bsg: 3 blocks")
    assert main(["convert", "bad.json", "strict.bsg", "--strict"]) == 2
    assert capsys.readouterr().err.startswith("agentflow: bad.json is not a valid machine: blocks")
    assert not Path("strict.bsg").exists()


def test_a_run_stands_for_its_best_machine(capsys: Captured) -> None:
    best = json.loads((RECORDED / "result.json").read_text())["machine"]
    for ending in (".json", ".bsg", ".glb"):
        assert f"best{ending}: {len(best)} blocks" in out(
            capsys, "convert", str(RECORDED), f"best{ending}"
        )
    assert json.loads(Path("best.json").read_text()) == best
    assert Path("best.glb").read_bytes().startswith(b"glTF")
    assert main(["convert", "best.bsg", "back.json"]) == 0
    assert json.loads(Path("back.json").read_text()) == best
    capsys.readouterr()
    assert "machine valid: yes" in out(capsys, "check", str(RECORDED), "--task", "throwing")
    out(capsys, "convert", str(RECORDED), "own.xml")
    out(capsys, "convert", str(RECORDED), "named.xml", "--task", "throwing")
    assert Path("own.xml").read_text() == Path("named.xml").read_text()
    Path("empty").mkdir()
    assert main(["convert", "empty", "x.json"]) == 2
    assert "empty is not a run directory" in capsys.readouterr().err


def test_extended_types_are_converted() -> None:
    machine = build((39, 0, 0), (45, 0, 2, 0, 3))
    Path("cogs.json").write_text(machine.to_text())
    assert main(["convert", "cogs.json", "cogs.bsg", "--strict"]) == 0


def test_what_a_format_cannot_hold_is_noted(capsys: Captured) -> None:
    assert out(capsys, "convert", "car.json", "car.urdf").splitlines() == [
        "note: URDF does not hold air drag, friction between surfaces, or the strength of "
        "connections",
        "note: motors are limits of effort and velocity; comments say which way they turn",
        "car.urdf: 7 blocks",
    ]
    assert Path("car.urdf").read_text().startswith("<?xml version='1.0' encoding='utf-8'?>\n<robot")
    told = out(capsys, "convert", "car.json", "car.glb", "--task", "movement")
    assert told.splitlines()[0] == "note: --task has no effect: it is for .xml files"


@pytest.mark.parametrize("ending", [".bsg", ".coords.json"])
def test_a_plate_is_no_block_of_the_game(ending: str, capsys: Captured) -> None:
    Path("train.json").write_text('[{"type": 9000, "id": 0, "parent": -1, "face_id": -1}]')
    assert main(["convert", "train.json", f"made{ending}"]) == 2
    assert capsys.readouterr().err == (
        "agentflow: train.json cannot be converted: it is built on a plate, which is not a block "
        "of the game; convert it to .json or .glb\n"
    )
    assert not Path(f"made{ending}").exists()
    assert main(["convert", "train.json", "made.json"]) == 0


def test_what_cannot_be_taken_over_is_named(capsys: Captured) -> None:
    assert out(capsys, "convert", "foreign.bsg", "made.json").splitlines() == [
        "skipped: block 1 of the file (id '57', guid '" + guid(FOREIGN) + "'): type 57 is unknown; "
        "the nearest types are 56 (Water Cannon), 55 (Small Propeller), 60 (Large Unpowered Wheel)",
        *(
            f"skipped: block {wheel} (Powered Wheel) has no parent at ({x}, 0, 1): no earlier "
            f"block has a face within 0.1 m that faces {way}; the nearest such face is {face} of "
            f"block 0 (Starting Block) at ({x}, 0, 0)"
            for wheel, x, way, face in ((3, -0.5, "x-", 2), (4, 0.5, "x+", 3))
        ),
        "made.json: 4 blocks",
    ]
    assert len(json.loads(Path("made.json").read_text())) == 4


def guid(text: str) -> str:
    return text.split('guid="')[2].split('"')[0]


WRONG = [
    (["convert", "foreign.bsg", "x.json", "--strict"], "foreign.bsg cannot be converted: block 1 "),
    (["convert", "bad.json", "x.bsg"], "bad.json cannot be converted: block 0 has no 'type' (and "),
    (
        ["convert", "car.json", "x.obj"],
        "cannot write x.obj: use one of the suffixes .coords.json, .json, ",
    ),
    (["convert", "car.json", "."], "cannot write .: use one of the suffixes .coords.json, .json, "),
    (["convert", "car.json", "folder.urdf"], "cannot write folder.urdf: Is a directory"),
    (["convert", "car.json", "no/x.urdf"], "cannot write no/x.urdf: No such file or directory"),
    (
        ["convert", "car.json", "x.xml"],
        "x.xml holds the scene of a task: name the task with --task",
    ),
    (["convert", "car.json", "x.xml", "--task", "moving"], "unknown task 'moving'; known: "),
    (
        ["convert", "catapult.json", "x.xml", "--task", "movement"],
        "catapult.json is not a valid machine: block 12: type 30 (Container) is not allowed here",
    ),
    (
        ["convert", "overlap.json", "x.urdf"],
        "overlap.json is not a valid machine: blocks 1, 2 share face 0 of block 0 (Starting Block)",
    ),
    (
        ["convert", "catapult.json", "x.urdf"],
        "URDF holds one connected machine, but no joint connects block 13 to block 0; remove ",
    ),
    (["convert", "car.json", "no/x.json"], "cannot write no/x.json: No such file or directory"),
    (
        ["convert", "bomb.bsg", "x.json"],
        "bomb.bsg contains no machine: the XML declares a document ",
    ),
    (
        ["convert", "empty.bsg", "x.json"],
        "empty.bsg contains no machine: this is not well-formed XML: ",
    ),
    (
        ["check", "foo.bsg"],
        "foo.bsg contains no machine: this is not a Besiege machine file: it has ",
    ),
    (
        ["convert", "lone.bsg", "x.json"],
        "lone.bsg cannot be converted: only its Starting Block would remain: block ",
    ),
    (
        ["render", ".", "--task", "movement"],
        ". is not a run directory: it has no readable run.yaml",
    ),
    (["convert", "none.json", "x.json"], "cannot read none.json: No such file or directory"),
    (
        ["check", "bomb.bsg"],
        "bomb.bsg contains no machine: the XML declares a document type, which ",
    ),
    (["check", "car.json", "--format", "xml"], "Invalid value for '--format': 'xml' is "),
    (["edit", "-"], "machine and script cannot both come from standard input; use --script "),
    (["edit", "bad.json", "--script", "bad.json"], "bad.json cannot be edited: block 0 has no 't"),
    (["edit", "car.json", "--script", "none"], "cannot read none: No such file or directory"),
    (["edit", "car.json", "--out", "car.bsg"], "car.bsg is not a .json file: write one, then "),
    (["edit", "-", "--jsonl", "--out", "x.json"], "--out needs a single machine; remove --jsonl"),
]


@pytest.mark.parametrize(("arguments", "message"), WRONG, ids=lambda v: str(v)[:50])
def test_wrong_input_is_one_line(arguments: list[str], message: str, capsys: Captured) -> None:
    Path("bad.json").write_text("[{}]")
    Path("bomb.bsg").write_text('<!DOCTYPE a [<!ENTITY b "c">]><Machine>&b;</Machine>')
    Path("overlap.json").write_text(OVERLAPPING.to_text())
    Path("catapult.json").write_text(CATAPULT.to_text())
    Path("folder.urdf").mkdir()
    Path("empty.bsg").write_text("")
    Path("foo.bsg").write_text("<Foo/>")
    Path("lone.bsg").write_text(re.sub(r'Block id="[1-9]\d*"', 'Block id="99"', FOREIGN))
    assert main(arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith(f"agentflow: {message}")
    assert captured.err.count("\n") == 1
    assert not list(Path().glob("x.*"))


def test_check_says_whether_the_rules_of_the_task_are_met(capsys: Captured) -> None:
    assert "rules of movement: met\n" in out(capsys, "check", "car.json", "--task", "movement")
    assert "rules of" not in out(capsys, "check", "car.json")
    root = {"type": 0, "id": 0, "parent": -1, "face_id": -1}
    overlapping = [root, *({"type": 1, "id": id_, "parent": 0, "face_id": 0} for id_ in (1, 2))]
    for machine, task, told in (
        (overlapping, "movement", "met"),
        (json.loads(Path("car.json").read_text()), "throwing", "not met"),
        ([], "movement", "not checked"),
    ):
        Path("tried.json").write_text(json.dumps(machine))
        assert f"rules of {task}: {told}\n" in out(capsys, "check", "tried.json", "--task", task)


def test_edit_with_out_names_the_file_in_place_of_its_content(capsys: Captured) -> None:
    Path("script.txt").write_text("Remove 3")
    edit = ("edit", "car.json", "--script", "script.txt")
    assert '"blocks"' in out(capsys, *edit) or '"type"' in out(capsys, *edit)
    told = out(capsys, *edit, "--out", "new.json")
    assert told.endswith("success\nmachine: new.json\n")
    assert json.loads(Path("new.json").read_text())
