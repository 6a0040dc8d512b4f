"""The parts list of a machine, and instructions that show step by step how it is put together."""

import csv
import io
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from agentflow.env.drawing.cameras import View, camera_at, fit
from agentflow.env.drawing.raster import corners_of
from agentflow.env.drawing.solids import MachineSolids
from agentflow.env.drawing.stills import picture_url, render_image
from agentflow.env.scene import SceneObject
from agentflow.machine import Geometry, Machine, library, place
from agentflow.machine.blocks.types import Color
from agentflow.machine.geometry.pose import Placed
from agentflow.making.parts import parts_of

COLUMNS = ("type", "name", "size", "number", "mass", "total_mass")


def bill(machine: Machine) -> list[dict[str, Any]]:
    """A row for each block type, by type; two-ended blocks have one for each length.

    Each has `type`, `name`, `size` (m: extents along the block's own x, y, z, or its length),
    `number`, `mass` (of one, kg) and `total_mass` (kg).
    """
    counts = Counter((part.kind.type, part.rod_length or 0.0) for part in parts_of(machine))
    rows = []
    for (number, long), count in sorted(counts.items()):
        kind = library()[number]
        size = " x ".join(f"{side:g}" for side in kind.size or (round(long, 3),))
        row = {"type": number, "name": kind.name, "size": size, "number": count}
        rows.append({**row, "mass": kind.mass, "total_mass": round(count * kind.mass, 6)})
    return rows


def bill_csv(machine: Machine) -> str:
    """The parts list as a table, with a line of headings."""
    text = io.StringIO()
    writer = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(bill(machine))
    return text.getvalue()


AT_ONCE = 4
"""Most blocks of a step; there are at least two, unless the machine has only one."""
SIZE = (640, 480)
PALE = 0.72
"""How far blocks of earlier steps fade to white."""
COLORS = 64
SIDES = {1: ("right", "front"), -1: ("left", "back")}
WAYS = {"x+": "right", "x-": "left", "y+": "top", "y-": "bottom", "z+": "front", "z-": "back"}


@dataclass(frozen=True)
class GuideStep:
    """What is put on at once.

    `parts` says how many of which type, and `where` what each block is put on; `picture` is the
    data URL of a PNG.
    """

    blocks: tuple[int, ...]
    parts: tuple[tuple[int, str], ...]
    where: tuple[str, ...]
    seen_from: str
    picture: str


def steps_of(order: Sequence[int]) -> Iterator[tuple[int, ...]]:
    """An order in parts of almost the same size."""
    count = -(-len(order) // AT_ONCE)
    for i in range(count):
        yield tuple(order[i * len(order) // count : (i + 1) * len(order) // count])


def guide(machine: Machine, order: Sequence[int], title: str) -> str:
    """The page of a machine whose blocks are put on in this order."""
    import jinja2

    loader = jinja2.PackageLoader("agentflow.making", "")
    template = jinja2.Environment(loader=loader, autoescape=True).get_template("guide.html.j2")
    geometry, figures = place(machine), MachineSolids(machine)
    solids = figures.objects(figures.rest)
    steps: list[GuideStep] = []
    for blocks in steps_of(order):
        done = {block for step in steps for block in step.blocks}
        steps.append(_step(geometry, solids, blocks, done))
    whole = _picture(solids, View(size=SIZE))
    return template.render(
        title=title, steps=steps, rows=bill(machine), whole=whole, blocks=len(machine)
    )


def _step(
    geometry: Geometry, solids: Sequence[SceneObject], blocks: tuple[int, ...], done: set[int]
) -> GuideStep:
    new = [solid for solid in solids if _block(solid) in blocks]
    old = [replace(solid, color=_faded(solid)) for solid in solids if _block(solid) in done]
    middle = np.mean([geometry[block].center for block in blocks], axis=0) - geometry.middle
    right, front = (1 if middle[0] >= -1e-6 else -1), (1 if middle[2] > 1e-6 else -1)
    view = View(back=(0.72 * right, 0.42, 0.62 * front), size=SIZE)
    names = Counter(geometry[block].name for block in blocks)
    return GuideStep(
        blocks,
        tuple((count, name) for name, count in names.items()),
        tuple(_where(geometry, geometry[block]) for block in blocks),
        f"{SIDES[front][1]} {SIDES[right][0]}",
        _picture(new, view, old),
    )


def _faded(solid: SceneObject) -> Color:
    red, green, blue = (PALE + (1 - PALE) * part for part in solid.color[:3])
    return red, green, blue, 1.0


def _block(solid: SceneObject) -> int:
    return int(solid.name.removeprefix("block "))


def _where(geometry: Geometry, placed: Placed) -> str:
    ends = [
        f"{geometry[parent].label}, {WAYS[geometry[parent].faces[face].facing]} (face {face})"
        for parent, face in placed.step.attachments
    ]
    if not ends:
        return f"{placed.label} comes first"
    return f"{placed.label} {'between' if placed.two_ended else 'on'} {' and '.join(ends)}"


def _picture(new: Sequence[SceneObject], view: View, old: Sequence[SceneObject] = ()) -> str:
    """A picture of new solids and old ones, which are as glass where they would hide new ones."""
    target, distance = fit(np.concatenate([corners_of(solid) for solid in (*new, *old)]), view)
    return picture_url(
        render_image(camera_at(target, distance, view), new, (), old).quantize(COLORS)
    )
