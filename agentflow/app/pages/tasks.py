"""Drawings of levels: a picture of one, a page of several."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from PIL import Image

from agentflow.app.tasks import find_task, list_tasks, task_json
from agentflow.env.drawing.plan_drawing import PngPen, SvgPen, draw_plans, place_plans
from agentflow.env.drawing.plans import level_plans
from agentflow.env.drawing.stills import level_png
from agentflow.errors import UsageError
from agentflow.files.atomic import write_output

PICTURE = (320, 240)
"""Width and height of the small pictures of levels, in pixels."""


def picture_name(name: str) -> str:
    """File name of a level's picture: "throwing/3" -> "throwing-3.png", "a/b.yaml" -> "b.png"."""
    if name.endswith((".yaml", ".yml")):
        return f"{Path(name).stem}.png"
    return name.replace("/", "-") + ".png"


def draw_task(name: str, settings: Iterable[str], file: Path) -> Path:
    """Draw a level from above and from the right, with axes in metres."""
    if file.suffix.lower() != ".png":
        raise UsageError(f"the picture must be a .png file, not {file.name!r}")
    task = find_task(name, settings)
    views = level_plans(task)
    pen = PngPen(place_plans(views)[1])
    draw_plans(views, task.scene().wind, pen)
    few = pen.picture.quantize(64, dither=Image.Dither.NONE)
    with write_output(file) as part:
        file.parent.mkdir(parents=True, exist_ok=True)
        few.save(part, "PNG", optimize=True)
    return file


def draw_all(folder: Path) -> list[Path]:
    """Draw every level into a folder."""
    names = [item["name"] for item in list_tasks()]
    return [draw_task(name, (), folder / picture_name(name)) for name in names]


def write_page(names: Iterable[str], file: Path) -> Path:
    """Write a self-contained HTML page of levels, for light and dark themes."""
    import jinja2

    loader = jinja2.PackageLoader("agentflow.app.pages", "")
    template = jinja2.Environment(loader=loader, autoescape=True).get_template("tasks.html.j2")
    levels = [_level(number, name) for number, name in enumerate(names)]
    families = list(dict.fromkeys(level["family"] for level in levels))
    text = template.render(levels=levels, families=families)
    with write_output(file) as part:
        file.parent.mkdir(parents=True, exist_ok=True)
        part.write_text(text, encoding="utf-8")
    return file


def _level(number: int, name: str) -> dict[str, Any]:
    task, pen = find_task(name), SvgPen(f"clip-{number}")
    views = level_plans(task)
    draw_plans(views, task.scene().wind, pen)
    svg = pen.to_svg(place_plans(views)[1], f"{task.name} from above and from the right")
    small = b64encode(level_png(task.brief.given, task.scene(), PICTURE)).decode()
    shown = {"anchor": f"level-{number}", "svg": svg, "unit": task.unit, "small": small}
    return {**task_json(name), **shown}
