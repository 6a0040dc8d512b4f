"""Commands that write pictures, films and 3D files."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from PIL import Image, features

from agentflow.cli import main
from agentflow.env.drawing.gltf import machine_glb
from tests.env.machines import CAR

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
    ending: str,
    first: bytes,
    options: list[str],
    car: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    if ending == ".mp4" and not features.check("avif"):
        pytest.skip("this Pillow cannot encode AV1")
    out = tmp_path / f"out{ending}"
    assert main(["render", car, *options, "--out", str(out)]) == 0
    assert capsys.readouterr().out == f"{out}\n"
    assert out.read_bytes().startswith(first)


@pytest.mark.slow
def test_without_a_suffix_both_a_picture_and_a_film_are_written(
    car: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
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
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["render", car, *options]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["car.json"]


def test_a_machine_that_overlaps_is_not_drawn(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    steps = [{"type": 0, "id": 0, "parent": -1, "face_id": -1}]
    steps += [{"type": 1, "id": i, "parent": 0, "face_id": 0} for i in (1, 2)]
    path = tmp_path / "bad.json"
    path.write_text(json.dumps(steps))
    assert main(["render", str(path), "--out", str(tmp_path / "x.png")]) == 2
    assert f"{path} cannot be built: " in capsys.readouterr().err


def test_a_machine_is_converted_to_glb(car: str, tmp_path: Path) -> None:
    assert main(["convert", car, str(tmp_path / "car.glb")]) == 0
    assert (tmp_path / "car.glb").read_bytes() == machine_glb(CAR)
