"""Drawings of levels: content, files, errors."""

from __future__ import annotations

import io
import json
import re
from pathlib import Path

import pytest
from PIL import Image

from agentflow.app.pages.tasks import SMALL, draw_task, level_picture, picture_name, write_page
from agentflow.app.tasks import task_json
from agentflow.env.drawing.plans import base_name, level_plans
from agentflow.env.tasks.registry import get_task
from agentflow.errors import UnknownNameError, UsageError

OWN = "family: throwing\ntitle: low <walls>\ngood: 12\nparameters:\n  wall: {height: 0.5}\n"


def test_a_plan_is_in_metres() -> None:
    above, right = level_plans(get_task("throwing"))
    front = next(line for line in above.outlines if line.name == "front wall")
    assert (min(front.points), max(front.points)) == ((10.6, -10.6), (11.4, 10.6))
    (low, high) = (min(y for _, y in line.points) for line in right.outlines[:2])
    assert (low, high) == (0.0, 0.0)
    assert {(min(axis), max(axis)) for axis in zip(*above.start, strict=True)} == {(-8.5, 8.5)}
    beside = {line.name for line in right.outlines if not line.filled}
    assert beside == {"left wall", "right wall"}


def test_given_blocks_are_drawn() -> None:
    above, _ = level_plans(get_task("gearing/5"))
    names = {base_name(line.name) for line in above.outlines}
    assert names == {"Plate", "Powered Cog", "Medium Cog"}


def test_pieces_share_a_name() -> None:
    names = ("ring 1, piece 12", "wall left", "slab 1-4", "ramp 0")
    assert [base_name(name) for name in names] == ["ring", "wall left", "slab", "ramp"]


def test_a_picture_is_written_to_the_requested_file(tmp_path: Path) -> None:
    file = draw_task("throwing/3", ("wind.speed=8",), tmp_path / "new" / picture_name("throwing/3"))
    assert file.name == "throwing-3.png"
    with Image.open(file) as picture:
        assert picture.width == 1800
        assert picture.height > 600


def test_a_users_level_is_shown_like_any_other(tmp_path: Path) -> None:
    own = tmp_path / "low.yaml"
    own.write_text(OWN, encoding="utf-8")
    assert picture_name(str(own)) == "low.png"
    found = task_json(str(own))
    assert (found["family"], found["title"], found["good"]) == ("throwing", "low <walls>", 12.0)
    page = write_page([str(own), "gearing"], tmp_path / "page.html").read_text(encoding="utf-8")
    assert "low \\u003cwalls\\u003e" in page
    [data] = re.findall(r'id="data">(.*)</script>', page)
    for level in json.loads(data)["levels"]:
        assert [drawing[0] for drawing in level["drawings"]] == ["svg", "svg"]
        assert level["picture"].startswith("data:image/png;base64,")


def test_the_picture_of_a_level_shows_its_scene() -> None:
    def pixels(name: str) -> Image.Image:
        return Image.open(io.BytesIO(level_picture(name, SMALL)))

    assert pixels("throwing").size == SMALL
    assert pixels("throwing").tobytes() != pixels("throwing/4").tobytes()


def test_drawing_errors_are_reported(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"^the picture must be a .png file, not 'a.gif'$"):
        draw_task("throwing", (), tmp_path / "a.gif")
    (tmp_path / "file").touch()
    with pytest.raises(UsageError, match=r"^cannot write .*: (Not a directory|File exists)$"):
        draw_task("throwing", (), tmp_path / "file" / "a.png")
    with pytest.raises(UnknownNameError, match=r"^unknown task 'trowing'; known: throwing"):
        draw_task("trowing", (), tmp_path / "a.png")
