"""Drawings of levels: a picture of one, a page of several."""

from __future__ import annotations

import base64
from collections.abc import Iterable
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from agentflow.app.tasks import find_task, list_tasks, task_json
from agentflow.env.drawing.plan_drawing import PngPen, SvgPen, draw_plans, place_plans
from agentflow.env.drawing.plans import level_plans
from agentflow.env.drawing.stills import level_png, save_drawing
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.records import record_machine, record_of
from agentflow.machine import Machine
from agentflow.report import page as report

NARROW = 420.0
"""Width of the drawings of plans on a page, in points: readable on a phone, two side by side."""
SMALL, LARGE = (400, 300), (960, 720)
"""Width and height of pictures in pixels: on cards, and of one level."""


def picture_name(name: str) -> str:
    """File name of a level's picture: "throwing/3" -> "throwing-3.png", "a/b.yaml" -> "b.png"."""
    if name.endswith((".yaml", ".yml")):
        return f"{Path(name).stem}.png"
    return name.replace("/", "-") + ".png"


def draw_task(name: str, settings: Iterable[str], file: Path) -> Path:
    """Draw a level from above and from the right, with axes in metres."""
    task = find_task(name, settings)
    sheets = place_plans(level_plans(task))
    pen = PngPen(sheets[-1].bottom)
    draw_plans(sheets, task.scene().wind, pen)
    return save_drawing(pen.picture, file)


def draw_all(folder: Path) -> list[Path]:
    """Draw every level into a folder."""
    names = (item["name"] for item in list_tasks())
    return [draw_task(name, (), folder / picture_name(name)) for name in names]


def write_page(names: Iterable[str], file: Path) -> Path:
    """Write a self-contained HTML page of levels."""
    levels = [level_data(name) for name in names]
    size = LARGE if len(levels) == 1 else SMALL
    for level in levels:
        picture = base64.b64encode(level_picture(level["name"], size)).decode()
        level["picture"] = f"data:image/png;base64,{picture}"
    file.parent.mkdir(parents=True, exist_ok=True)
    report.write_page(file, "Tasks · agentflow", {"kind": "tasks", "levels": levels})
    return file


def level_data(name: str) -> dict[str, Any]:
    """One level with drawings from above and from the right, for a page."""
    task, drawings = find_task(name), []
    for number, placed in enumerate(place_plans(level_plans(task), NARROW)):
        sheet, pen = replace(placed, top=0.0), SvgPen(f"plan-{number}")
        draw_plans([sheet], task.scene().wind, pen)
        drawings.append(pen.to_svg(sheet, f"{task.name} {placed.plan.title}"))
    machine, about = _shown_machine(task)
    shown = {"drawings": drawings, "machine": about, "recorded": machine != task.brief.given}
    return {**task_json(name), "unit": task.unit, **shown}


@lru_cache(maxsize=200)
def level_picture(name: str, size: tuple[int, int]) -> bytes:
    """A level with a machine at its start, as a PNG file."""
    task = find_task(name)
    return level_png(_shown_machine(task)[0], task.scene(), size)


def _shown_machine(task: Task) -> tuple[Machine, str]:
    """The machine in the picture of a level, and what it is: that of the record where the
    repository is at hand, else the blocks that all machines begin with."""
    record = record_of(task)
    best = record and record_machine(record.name)
    return (best, "the machine of its record") if best else (task.brief.given, "the first block")
