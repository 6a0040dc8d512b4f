"""Commands that write pictures, films and 3D files."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, features

from agentflow.app.pages.pictures import draw_missing
from agentflow.cli import main
from agentflow.env.drawing.glb import machine_glb
from agentflow.env.drawing.solids import BROKEN
from agentflow.errors import RunError
from tests.env.machines import CAR
from tests.machine.builders import build

Captured = pytest.CaptureFixture[str]

RECORDED = Path(__file__).parents[3] / "runs" / "recorded-throwing"
SHORT = ["--task", "movement", "--set", "window=1"]


@pytest.fixture
def car(tmp_path: Path) -> str:
    path = tmp_path / "car.json"
    path.write_text(json.dumps([step.to_json() for step in CAR]))
    return str(path)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("ending", "first", "options"),
    [
        (".png", b"\x89PNG", []),
        (".png", b"\x89PNG", ["--view", "top"]),
        (".gif", b"GIF89a", SHORT),
        (".mp4", b"\x00\x00\x00", SHORT),
        (".glb", b"glTF", SHORT),
    ],
)
def test_the_suffix_decides_the_format(
    ending: str, first: bytes, options: list[str], car: str, tmp_path: Path, capsys: Captured
) -> None:
    if ending == ".mp4" and not features.check("avif"):
        pytest.skip("this Pillow cannot encode AV1")
    out = tmp_path / f"out{ending}"
    assert main(["render", car, *options, "--out", str(out)]) == 0
    assert capsys.readouterr().out == f"{out}\n"
    assert out.read_bytes().startswith(first)


@pytest.mark.slow
def test_without_a_suffix_both_a_picture_and_a_film_are_written(
    car: str, tmp_path: Path, capsys: Captured
) -> None:
    assert main(["render", car, *SHORT, "--out", str(tmp_path / "it")]) == 0
    assert capsys.readouterr().out == f"{tmp_path / 'it.png'}\n{tmp_path / 'it.gif'}\n"
    with Image.open(tmp_path / "it.gif") as film:
        assert (film.size, getattr(film, "n_frames", 1)) == ((480, 360), 11)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--out", "x.bmp"], "unknown kind of picture '.bmp'; known: .mp4, .png, .glb, .gif"),
        (
            ["--out", "x.png", "--view", "below"],
            "unknown view 'below'; known: front, back, left, right, top, three-quarter, sheet",
        ),
        (["--out", "x.png", "--size", "big"], "--size takes width and height, such as 1920x1080"),
        (["--out", "x.png", "--size", "9x9"], "--size takes 16 to 4096 pixels"),
        (["--out", "x.gif", "--fps", "60"], "60 for an .mp4 file and 1 to 50 for a .gif file"),
        (["--out", "x.gif", "--axes"], "draw a machine as built: a .png file without --moments"),
        (["--out", "x.png", "--moments", "1"], "--moments takes 2 to 12, for a .png file"),
        (["--out", "x.png", "--style", "oil"], "unknown style 'oil'; known: screen, paper"),
        (["--scale"], "name one file to draw, such as --out picture.png or film.mp4"),
        (["--out", "nowhere/x.png"], "cannot write nowhere/x.png: No such file or directory"),
        (
            ["--task", "throwing", "--out", "x.gif"],
            "nothing to film: the rollout ended with status invalid (",
        ),
    ],
)
def test_writing_errors_are_reported_in_one_line(
    options: list[str],
    message: str,
    car: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: Captured,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["render", car, *options]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["car.json"]


RED = tuple(int(255 * part) for part in BROKEN[:3])


def count_red(file: Path) -> int:
    """Pixels in a shade of the colour of broken blocks."""
    with Image.open(file) as picture:
        pixels = np.array(picture.convert("RGB")).astype(int)
    shade = pixels.max(axis=2, keepdims=True) / max(RED)
    close = np.abs(pixels - shade * RED).max(axis=2) < 12
    return int((close & (pixels[:, :, 0] > 100)).sum())


@pytest.mark.slow
def test_overlaps_of_an_invalid_machine_are_drawn_in_red(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("bad.json").write_text(build((1, 0, 0), (15, 0, 0), (1, 0, 1)).to_text())
    Path("good.json").write_text(build((1, 0, 0), (1, 0, 1)).to_text())
    assert main(["render", "good.json", "--out", "good.png"]) == 0
    assert capsys.readouterr() == ("good.png\n", "")
    assert main(["render", "bad.json"]) == 0
    told = capsys.readouterr()
    assert told.out == "machine.png\n"
    assert told.err.startswith("agentflow: bad.json is not valid: blocks 1, 2 share face 0 of ")
    assert told.err.endswith("; overlapping blocks are red\n")
    assert count_red(Path("good.png")) == 0
    assert count_red(Path("machine.png")) > 2000
    for name in ("x.gif", "x.glb"):
        assert main(["render", "bad.json", "--out", name]) == 2
        assert capsys.readouterr().err.startswith(
            "agentflow: bad.json can only be drawn (.png), because it is not valid: blocks 1, 2 "
        )
    Path("none.json").write_text("[{}]")
    assert main(["render", "none.json"]) == 2
    assert "none.json cannot be built: block 0 has no 'type'" in capsys.readouterr().err


def test_a_machine_is_converted_to_glb(car: str, tmp_path: Path) -> None:
    assert main(["convert", car, str(tmp_path / "car.glb")]) == 0
    assert (tmp_path / "car.glb").read_bytes() == machine_glb(CAR)


@pytest.mark.slow
def test_pictures_that_a_kill_or_a_full_disk_has_cost_are_drawn_on_resume(
    tmp_path: Path, capsys: Captured
) -> None:
    few = ["--set", "window=1", "--set", "trajectories=1", "--set", "search.rounds=0"]
    job = ["design", "--task", "movement", "--workflow", "single", *few, "--quiet"]
    assert main([*job, "--set", "verify=false", "--out", str(tmp_path), "--name", "run"]) == 0
    picture, film = tmp_path / "run" / "best.png", tmp_path / "run" / "best.gif"
    before, drawn_at = picture.read_bytes(), film.stat().st_mtime_ns
    picture.unlink()
    assert main(["design", "--resume", str(tmp_path / "run"), "--quiet"]) == 0
    assert str(picture) in capsys.readouterr().out
    assert (picture.read_bytes(), film.stat().st_mtime_ns) == (before, drawn_at)


def test_pictures_that_cannot_be_drawn_say_how_to_draw_them_later(tmp_path: Path) -> None:
    shutil.copytree(RECORDED, tmp_path / "run")
    result = tmp_path / "run" / "result.json"
    content = json.loads(result.read_text()) | {"machine": None, "valid": False, "reason": "none"}
    result.write_text(json.dumps(content))
    with pytest.raises(RunError, match=r"draw its pictures with agentflow design --resume .*run$"):
        draw_missing(tmp_path / "run")
