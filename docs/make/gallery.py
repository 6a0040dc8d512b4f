"""The gallery: the best known machine of each level in 3D, on one page that loads nothing."""

from __future__ import annotations

import asyncio
import base64
import html
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any

from agentflow.app.pages.films import Shapes, machine_data
from agentflow.app.pages.runs import COARSE, THUMBNAIL, task_wording
from agentflow.env.drawing.stills import png_url
from agentflow.env.physics.engines import usable_engine
from agentflow.env.pool.pool import RolloutPool
from agentflow.env.rollout import Rollout
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.records import TaskRecord, record_machine, record_of
from agentflow.env.tasks.registry import get_level, get_task
from agentflow.machine import Machine
from agentflow.progress import Progress, counter
from agentflow.report.page import write_page

VIEWER = "machines.html"
TITLE = "The best known machines"
ABOUT = (
    "The machine with the highest verified score of each level. Click one to watch it in 3D: drag "
    "to turn it, scroll to come closer. [Tasks](../reference/tasks.md) explains the scores."
)


@dataclass(frozen=True)
class Exhibit:
    """The best known machine of one level."""

    record: TaskRecord
    machine: Machine
    task: Task
    picture: str
    """As a data URL."""

    @classmethod
    def of(cls, level: str) -> Exhibit | None:
        """The machine of a level; None if none is known."""
        record = record_of(get_task(level))
        machine = record_machine(record.name) if record else None
        if record is None or machine is None:
            return None
        engine = usable_engine(record.engine.partition(" ")[0])
        task = get_task(level, record.knobs, engine)
        picture = png_url(machine, view="three-quarter", size=THUMBNAIL)
        return cls(record, machine, task, picture)

    @property
    def title(self) -> str:
        """The title of its level."""
        return get_level(self.record.task).file.title

    @property
    def blocks(self) -> str:
        """How many blocks count."""
        count = self.task.brief.count_blocks(self.record.size)
        return f"{count} {'block' if count == 1 else 'blocks'}"

    @property
    def file(self) -> str:
        """Name of the file of its picture."""
        return f"{self.record.task.replace('/', '-')}.png"


def write_gallery(folder: Path, levels: Sequence[str], *, workers: int, say: Progress) -> None:
    """Write the page of the site, its pictures, and the viewer with the films.

    Each machine is simulated once: where a level has several trials, in the first one.
    """
    exhibits = [found for level in levels if (found := Exhibit.of(level))]
    folder.mkdir(parents=True)
    for item in exhibits:
        content = base64.b64decode(item.picture.partition(",")[2])
        (folder / item.file).write_bytes(content)
    (folder / "index.md").write_text(_page(exhibits), encoding="utf-8")
    rollouts = asyncio.run(_simulate(exhibits, workers, say))
    write_page(folder / VIEWER, f"{TITLE} · agentflow", _viewer_data(exhibits, rollouts))


async def _simulate(exhibits: Sequence[Exhibit], workers: int, say: Progress) -> list[Rollout]:
    count = counter(say, len(exhibits))

    async def run(item: Exhibit) -> Rollout:
        trial = item.task.trials(item.record.seed)[0]
        rollout = await pool.run(
            item.machine, trial, seed=item.record.seed, interval=COARSE, recorded=True
        )
        count()
        return rollout

    async with RolloutPool(workers) as pool:
        return await asyncio.gather(*map(run, exhibits))


def _viewer_data(exhibits: Sequence[Exhibit], rollouts: Sequence[Rollout]) -> dict[str, Any]:
    shapes = Shapes()
    machines = {
        item.record.task: machine_data(item.machine, rollout, shapes, given=item.task.brief.given)
        for item, rollout in zip(exhibits, rollouts, strict=True)
    }
    cards = list(map(_card, exhibits))
    return {"kind": "gallery", "title": TITLE, "machines": machines, "cards": cards, **shapes.data}


def _card(item: Exhibit) -> dict[str, Any]:
    record = item.record
    return {
        "machine": record.task,
        "task": record.task,
        "asked": {"title": item.title, **task_wording(item.task.brief)},
        "about": item.blocks,
        "run": f"{record.how}; {record.engine}",
        "score": record.score,
        "verified": record.verified,
        "fragile": record.holding.fragile,
        "why": "",
        "picture": item.picture,
    }


def _page(exhibits: Sequence[Exhibit]) -> str:
    return "\n\n".join([f"# {TITLE}", ABOUT, *_families(exhibits)]) + "\n"


def _families(exhibits: Sequence[Exhibit]) -> Iterator[str]:
    for family, items in groupby(exhibits, lambda item: item.record.task.partition("/")[0]):
        yield f"## {family}"
        yield "\n".join(['<div class="machines">', *map(_link, items), "</div>"])


def _link(item: Exhibit) -> str:
    width, height = THUMBNAIL
    name, about = item.record.task, html.escape(f"{item.title}, {item.blocks}")
    picture = f'<img src="{item.file}" alt="" loading="lazy" width="{width}" height="{height}">'
    fragile = " (fragile)" * item.record.holding.fragile
    text = f"<b>{name}</b> {item.record.verified:.4g}{fragile}<br><small>{about}</small>"
    return f'<a href="{VIEWER}#{name}">{picture}<span>{text}</span></a>'
