"""Parts lists and instructions, and what is refused, without any CAD library."""

from __future__ import annotations

import csv
import json
import re
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import pytest

from agentflow.app.machines.convert import FORMATS, Wishes, convert, list_parts, write_guide
from agentflow.cli import main
from agentflow.errors import ConfigError, UsageError
from agentflow.extras import install
from agentflow.machine import Machine, library
from agentflow.making.guide import steps_of
from agentflow.making.parts import Making, making
from tests.machine.builders import CATAPULT, build

MACHINES = Path(__file__).parents[1] / "machines"
BRACED = MACHINES / "braced_throw.json"


def saved(machine: Machine, folder: Path) -> str:
    file = folder / "machine.json"
    file.write_text(machine.to_text())
    return str(file)


def test_the_bill_equals_the_tree(tmp_path: Path) -> None:
    machine = Machine.from_file(BRACED)
    result = list_parts(str(BRACED), tmp_path / "bom.csv")
    with (tmp_path / "bom.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    counted = Counter[int]()
    for row in rows:
        kind = library()[int(row["type"])]
        counted[kind.type] += int(row["number"])
        assert row["name"] == kind.name
        assert float(row["mass"]) == kind.mass
        assert float(row["total_mass"]) == pytest.approx(int(row["number"]) * kind.mass)
    assert counted == Counter(step.type for step in machine)
    assert [row["size"] for row in rows if row["type"] == "7"] == ["4.743", "5.339"]
    mass = sum(library()[step.type].mass for step in machine)
    assert (result["blocks"], result["mass"]) == (17, pytest.approx(mass))


def test_the_bill_is_shown_and_written_as_markdown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = saved(build((63, 0, 0), (63, 0, 1)), tmp_path)
    assert main(["bom", source, "--out", str(tmp_path / "bom.md")]) == 0
    shown = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in shown] == ["type", "0", "63", "3"]
    assert shown[-1] == "3 blocks, 2.25 kg"
    lines = (tmp_path / "bom.md").read_text().splitlines()
    assert lines[-1] == "| 63 | Log | 1 x 1 x 3 | 2 | 1.00 | 2.00 |"
    assert main(["bom", source, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["rows"][1]["number"] == 2


def test_instructions_have_a_picture_and_the_parts_of_every_step(tmp_path: Path) -> None:
    result = write_guide(saved(CATAPULT, tmp_path), tmp_path / "guide.html")
    page = (tmp_path / "guide.html").read_text(encoding="utf-8")
    assert result["steps"] == [[0, 1, 2], [3, 4, 5, 6], [7, 8, 9], [10, 11, 12, 13]]
    assert page.count('src="data:image/png;base64,') == 1 + len(result["steps"])
    assert not re.search(r'(?:src|href)="(?!data:)', page), "it loads nothing"
    named = Counter(re.findall(r"<li>(\d+) \u00d7 ([^<]+)</li>", page))
    assert sum(int(count) * times for (count, _), times in named.items()) == len(CATAPULT)
    assert "<li>block 0 (Starting Block) comes first</li>" in page
    assert "<li>block 13 (Boulder) on block 12 (Container), top (face 0)</li>" in page


@pytest.mark.parametrize("count", [1, 2, 3, 4, 5, 8, 9, 41])
def test_steps_have_two_to_six_blocks(count: int) -> None:
    steps = list(steps_of(range(count)))
    assert [block for step in steps for block in step] == list(range(count))
    assert {len(step) for step in steps} <= ({1} if count == 1 else {2, 3, 4})


def test_the_size_that_tasks_allow_is_no_limit_of_making(tmp_path: Path) -> None:
    """The deep truss is 21 m long, which level 3 of bridge allows."""
    truss = str(MACHINES / "bridge" / "deep_truss.json")
    assert write_guide(truss, tmp_path / "guide.html")["blocks"] == 32
    assert convert(truss, tmp_path / "truss.urdf", Wishes())["blocks"] == 32


def test_what_cannot_be_built_gets_no_instructions(tmp_path: Path) -> None:
    clamp = str(MACHINES / "bridge" / "clamp.json")
    with pytest.raises(
        UsageError, match=r"clamp\.json: the machine cannot be built in any order: "
    ):
        write_guide(clamp, tmp_path / "guide.html")
    with pytest.raises(UsageError, match=r"machine\.json is not a valid machine: "):
        write_guide(saved(build((63, 0, 0), (63, 0, 0)), tmp_path), tmp_path / "guide.html")
    with pytest.raises(UsageError, match=r"instructions are an \.html file$"):
        write_guide(clamp, tmp_path / "guide.pdf")
    with pytest.raises(UsageError, match=r"a parts list is a \.csv or \.md file$"):
        list_parts(clamp, tmp_path / "bom.xls")
    assert list(tmp_path.glob("guide*")) == []


def test_sizes_are_read() -> None:
    assert making() == Making()
    assert making(10, "5mm") == Making(10, 5.0, parts=True)
    assert making(pegs=".5 mm").pegs == 0.5
    assert (making(10).millimetres(20), making().millimetres(20)) == (100, 50)


@pytest.mark.parametrize("scale", [-20, 0, 0.5, 1e6, float("nan")])
def test_an_absurd_scale_is_refused(scale: float) -> None:
    with pytest.raises(UsageError) as error:
        making(scale)
    assert str(error.value) == (
        f"--scale {scale:g} is no scale: give a number from 1 to 1000, such as 20 for 1 : 20"
    )


@pytest.mark.parametrize("pegs", ["", "thick", "-5mm", "0", "5cm", "1000mm", "5 5"])
def test_absurd_pegs_are_refused(pegs: str) -> None:
    with pytest.raises(UsageError) as error:
        making(pegs=pegs)
    assert str(error.value) == (
        f"--pegs {pegs!r} is no diameter: give millimetres up to 100, such as 5mm"
    )


@pytest.mark.parametrize(
    ("suffix", "library"),
    [(".step", "OCP"), (".stl", "manifold3d"), (".3mf", "manifold3d"), (".usda", "pxr")],
)
def test_without_the_libraries_the_extra_is_named(
    suffix: str, library: str, tmp_path: Path, without: Callable[[str], None]
) -> None:
    without(library)
    with pytest.raises(ConfigError) as error:
        convert(saved(CATAPULT, tmp_path), tmp_path / f"out{suffix}")
    assert str(error.value) == (f"{library} is not installed; install it with: {install('cad')}")


def test_options_that_change_nothing_are_noted(tmp_path: Path) -> None:
    wishes = Wishes(making=making(20, "5mm"))
    result = convert(saved(CATAPULT, tmp_path), tmp_path / "out.glb", wishes)
    assert result["notes"] == [
        "--scale has no effect: it is for .step and .stl and .3mf and .usda files",
        "--pegs has no effect: it is for .stl and .3mf files",
    ]
    assert [suffix for suffix, form in FORMATS.items() if form.options == ("--task",)] == [".xml"]
