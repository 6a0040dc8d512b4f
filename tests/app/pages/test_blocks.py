"""Pictures of blocks, and the table of blocks in the documentation."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from agentflow.app.machines.files import list_blocks
from agentflow.app.pages.blocks import AXES, PAPER, TILE, VIEWS, _example, _seen_faces
from agentflow.cli import main
from agentflow.cli.display.show_machines import _size
from agentflow.env.drawing.cameras import View, camera_at, fit
from agentflow.env.drawing.raster import corners_of
from agentflow.env.drawing.solids import MachineSolids
from agentflow.machine import library, place

DOCS = Path(__file__).parents[3] / "docs"
Captured = pytest.CaptureFixture[str]


def rows() -> list[str]:
    """The rows of the table in docs/reference/blocks.md."""
    return [
        f"| {block['type']} | {block['name']} | {_size(block)} | {block['mass']:g} | "
        f"{len(block['faces'])} | {'extended' if block['extended'] else 'core'} | "
        f"![{block['name']}](../pictures/blocks/{block['type']}.png) |"
        for block in list_blocks()
    ]


def test_the_documented_table_is_that_of_the_library() -> None:
    page = (DOCS / "reference" / "blocks.md").read_text(encoding="utf-8")
    assert [line for line in page.splitlines() if "](../pictures/blocks/" in line] == rows()
    files = sorted((DOCS / "pictures" / "blocks").iterdir())
    assert {int(file.stem) for file in files} == set(library())
    for file in files:
        with Image.open(file) as picture:
            assert picture.size == (2 * TILE[0], TILE[1])
        assert file.stat().st_size < 9000


@pytest.mark.parametrize("kind", library())
def test_every_face_is_seen_from_one_of_the_two_sides(kind: int) -> None:
    machine = _example(library()[kind])
    placed, solids = place(machine).blocks[-1], MachineSolids(machine)
    corners = np.concatenate([corners_of(thing) for thing in solids.things(solids.rest)])
    lift = np.subtract(solids.rest.centre[0], place(machine).blocks[0].center)
    seen: list[str] = []
    for direction in VIEWS.values():
        view = View(back=direction, size=TILE)
        camera = camera_at(*fit(corners, view), view)
        seen += [number for number, _ in _seen_faces(placed, camera, lift)]
    assert sorted(map(int, seen)) == [face.face_id for face in placed.faces]


def colours(file: Path) -> dict[tuple[int, ...], int]:
    with Image.open(file) as picture:
        found = np.array(picture.convert("RGB")).reshape(-1, 3)
    kinds, counts = np.unique(found, axis=0, return_counts=True)
    return {tuple(kind.tolist()): int(count) for kind, count in zip(kinds, counts, strict=True)}


def near(found: dict[tuple[int, ...], int], colour: tuple[int, int, int]) -> int:
    """Number of pixels in a colour or close to it."""
    close = (kind for kind in found if np.abs(np.subtract(kind, colour)).max() < 30)
    return sum(found[kind] for kind in close)


def test_a_picture_shows_the_block_and_its_axes(tmp_path: Path, capsys: Captured) -> None:
    file = tmp_path / "new" / "faces.png"
    assert main(["blocks", "log", "--picture", str(file)]) == 0
    assert capsys.readouterr().out == f"{file}\n"
    found = colours(file)
    assert all(near(found, colour) > 20 for colour in AXES.values())
    drawn = 1 - near(found, PAPER) / (2 * TILE[0] * TILE[1])
    assert 0.15 < drawn < 0.6


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["63", "--picture", "x.gif"], "the picture must be a .png file, not 'x.gif'"),
        (["no such", "--picture", "x.png"], "unknown block type 'no such'"),
    ],
)
def test_wrong_pictures_are_refused(options: list[str], message: str, capsys: Captured) -> None:
    assert main(["blocks", *options]) == 2
    assert capsys.readouterr().err.startswith(f"agentflow: {message}")
