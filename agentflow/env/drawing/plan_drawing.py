"""Drawing of level plans with axes in metres, as SVG or PNG."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import ceil, floor
from typing import Any, TypeAlias

from PIL import Image, ImageDraw, ImageFont

from agentflow.env.drawing.plans import LevelPlan, Outline, Point, base_name
from agentflow.machine.geometry.vectors import Vec3

WIDTH, TALLEST = 900.0, 420.0
"""Width of a drawing, and maximum height of one plan, in points."""
LEFT, RIGHT, TOP, BOTTOM = 48.0, 12.0, 26.0, 30.0
"""Margins around a plan, in points."""
STEPS = (1, 2, 5, 10, 20, 50)
"""Possible distances of grid lines, m."""
APART = 44.0
"""Minimum distance of grid lines, in points."""
GRID, FRAME, START = "grid", "frame", "start"
LETTER = 6.5
"""Approximate width of a letter, in points."""
LABELS = 14
"""Most labels in one plan."""
UPRIGHT = 4.0
"""Height of an outline, in widths, from which its label is in its middle: its end meets others."""


@dataclass(frozen=True)
class _PlacedPlan:
    """A plan and its place in the drawing; the scale is in points per metre."""

    plan: LevelPlan
    top: float
    scale: float

    @property
    def size(self) -> Point:
        (x0, y0), (x1, y1) = self.plan.low, self.plan.high
        return (x1 - x0) * self.scale, (y1 - y0) * self.scale

    def at(self, place: Point) -> Point:
        (x0, _), (_, y1) = self.plan.low, self.plan.high
        across, down = (place[0] - x0) * self.scale, (y1 - place[1]) * self.scale
        return LEFT + across, self.top + TOP + down

    @property
    def bottom(self) -> float:
        return self.top + TOP + self.size[1] + BOTTOM


def place_plans(plans: Sequence[LevelPlan], width: float = WIDTH) -> list[_PlacedPlan]:
    """Stack plans at one scale in a drawing of this width, in points."""
    scale = min(
        min((width - LEFT - RIGHT) / (plan.high[0] - plan.low[0]) for plan in plans),
        min(TALLEST / (plan.high[1] - plan.low[1]) for plan in plans),
    )
    placed: list[_PlacedPlan] = []
    for plan in plans:
        placed.append(_PlacedPlan(plan, placed[-1].bottom if placed else 0.0, scale))
    return placed


def draw_plans(sheets: Sequence[_PlacedPlan], wind: Vec3, pen: Pen) -> None:
    """Draw placed plans and note the wind."""
    for sheet in sheets:
        _draw(sheet, pen)
    if any(wind):
        words = "wind " + ", ".join(
            f"{speed:+g} m/s along {axis}" for speed, axis in zip(wind, "xyz", strict=True) if speed
        )
        pen.text((LEFT + sheets[0].size[0], TOP - 10), words, "end")


def _draw(sheet: _PlacedPlan, pen: Pen) -> None:
    plan = sheet.plan
    (x0, y0), (x1, y1) = sheet.at(plan.low), sheet.at(plan.high)
    pen.start_clip((x0, y1), (x1, y0))
    for number, across in _ticks(sheet):
        ends = ((number, plan.low[1]), (number, plan.high[1]))
        level = ((plan.low[0], number), (plan.high[0], number))
        pen.line([sheet.at(end) for end in (ends if across else level)], GRID)
    for outline in plan.outlines:
        pen.polygon([sheet.at(point) for point in outline.points], outline.color, outline.filled)
    pen.line([sheet.at(point) for point in (*plan.start, plan.start[0])], START)
    if plan.sign > 0:
        pen.line([sheet.at((plan.low[0], 0.0)), sheet.at((plan.high[0], 0.0))], FRAME)
    pen.end_clip()
    pen.line([(x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)], FRAME)
    for number, across in _ticks(sheet):
        x, y = sheet.at((number, number))
        words = f"{number if across else number * plan.sign:g}"
        pen.text((x, y0 + 14) if across else (x0 - 6, y + 4), words, "middle" if across else "end")
    pen.text((x0, y1 - 10), plan.title, "start")
    pen.text((x0 - 6, y1 - 10), f"{plan.upwards}, m", "end")
    pen.text((x1, y0 + 27), "z, m", "end")
    for place, words in _labels(sheet):
        pen.text(place, words, "middle")


def _ticks(sheet: _PlacedPlan) -> Iterator[tuple[int, bool]]:
    """Grid lines: their coordinate in whole metres, and whether it is z."""
    step = next((step for step in STEPS if step * sheet.scale >= APART), STEPS[-1])
    for axis in (0, 1):
        low, high = sheet.plan.low[axis], sheet.plan.high[axis]
        for number in range(ceil(low / step), floor(high / step) + 1):
            yield number * step, axis == 0


def _labels(sheet: _PlacedPlan) -> Iterator[tuple[Point, str]]:
    """One label per kind of object, above or beside its first visible piece, clear of others."""
    plan = sheet.plan
    taken, named = list[Point](), set[str]()
    left, right = sheet.at(plan.low)[0], sheet.at(plan.high)[0]
    middles = [(sum(x for x, _ in plan.start) / len(plan.start),
                max(y for _, y in plan.start), 0.0, "machine")]  # fmt: skip
    for outline in plan.outlines:
        name = base_name(outline.name)
        if outline.filled and name not in named and (spot := _label_point(outline, plan)):
            named.add(name)
            middles.append((*spot, name))
    for across, up, thick, name in middles[:LABELS]:
        place = sheet.at((across, up))
        half = LETTER * len(name) / 2
        apart = thick and thick * sheet.scale / 2 + half + 4
        x = place[0] + (apart if place[0] + apart + half < right else -apart)
        x = min(max(x, left + half), right - half)
        place = (x, max(place[1] - 4, sheet.top + TOP + 12))
        while any(abs(place[0] - u) < 70 and abs(place[1] - v) < 13 for u, v in taken):
            place = (place[0], place[1] + 13)
        taken.append(place)
        yield place, name


def _label_point(outline: Outline, plan: LevelPlan) -> tuple[float, float, float] | None:
    """Upper middle of an outline's visible part and 0, or the middle of one that stands upright and
    its width; None if it is outside the picture."""
    (x0, y0), (x1, y1) = plan.low, plan.high
    xs, ys = zip(*outline.points, strict=True)
    left, right, top = max(min(xs), x0), min(max(xs), x1), min(max(ys), y1)
    if not (left < right and y0 < top and min(ys) < y1):
        return None
    upright = top - max(min(ys), y0) > UPRIGHT * (right - left)
    x, middle = (left + right) / 2, (top + max(min(ys), y0)) / 2
    return (x, middle, right - left) if upright else (x, top, 0.0)


class SvgPen:
    """Draws SVG as `[name, attributes, *children]`; pages style lines by class (`grid`, `frame`,
    `start`).

    Coordinates are points of the drawing, y downwards.
    """

    def __init__(self, name: str) -> None:
        """Start a drawing whose name is unique in the page."""
        self._name = name
        self._whole: list[Any] = []
        self._parts = self._whole

    def polygon(self, points: Sequence[Point], color: tuple[float, ...], filled: bool) -> None:
        """Draw a filled polygon, or only its outline."""
        paint = "#" + "".join(f"{round(255 * part):02x}" for part in color[:3])
        fill = f"{paint}bf" if filled else "none"
        self._parts.append(["polygon", {"points": _places(points), "stroke": paint, "fill": fill}])

    def line(self, points: Sequence[Point], kind: str) -> None:
        """Draw a line in one of the line styles."""
        self._parts.append(["polyline", {"class": kind, "points": _places(points)}])

    def text(self, place: Point, words: str, anchor: str) -> None:
        """Write text; the anchor is `start`, `middle` or `end`."""
        self._parts.append(["text", {"x": place[0], "y": place[1], "class": anchor}, words])

    def start_clip(self, low: Point, high: Point) -> None:
        """Clip everything to a rectangle until `end_clip`."""
        (x, y), (u, v) = low, high
        box = ["rect", {"x": x, "y": y, "width": u - x, "height": v - y}]
        self._parts.append(["clipPath", {"id": self._name}, box])
        self._parts.append(group := ["g", {"clip-path": f"url(#{self._name})"}])
        self._parts = group

    def end_clip(self) -> None:
        self._parts = self._whole

    def to_svg(self, sheet: _PlacedPlan, about: str) -> list[Any]:
        """The finished drawing of one plan."""
        box = f"0 0 {LEFT + sheet.size[0] + RIGHT:.0f} {sheet.bottom:.0f}"
        return [
            "svg",
            {"viewBox": box, "class": "plan", "role": "img", "aria-label": about},
            *self._whole,
        ]


def _places(points: Sequence[Point]) -> str:
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in points)


PAPER, INK = (250, 249, 246), (40, 42, 48)
INKS = {GRID: (222, 221, 214), FRAME: (120, 122, 128), START: (30, 110, 190)}
SCALE = 2
"""Pixels per point."""


class PngPen:
    """Draws a bitmap; the same methods as `SvgPen`."""

    def __init__(self, height: float) -> None:
        """Start an empty drawing of this height in points."""
        self.picture = Image.new("RGB", (round(SCALE * WIDTH), round(SCALE * height)), PAPER)
        self._canvas, self._place = self.picture, (0, 0)
        self._font = ImageFont.load_default(size=12 * SCALE)

    def polygon(self, points: Sequence[Point], color: tuple[float, ...], filled: bool) -> None:
        red, green, blue = (round(255 * part) for part in color[:3])
        fill = (red, green, blue, 190) if filled else None
        pen, places = ImageDraw.Draw(self._canvas, "RGBA"), self._to_pixels(points)
        pen.polygon(places, fill=fill)
        pen.line([*places, places[0]], fill=(red, green, blue, 255), width=SCALE)

    def line(self, points: Sequence[Point], kind: str) -> None:
        ImageDraw.Draw(self._canvas).line(self._to_pixels(points), fill=INKS[kind], width=SCALE)

    def text(self, place: Point, words: str, anchor: str) -> None:
        side = {"start": "l", "middle": "m", "end": "r"}[anchor]
        (spot,) = self._to_pixels([place])
        ImageDraw.Draw(self._canvas).text(spot, words, INK, self._font, anchor=f"{side}s")

    def start_clip(self, low: Point, high: Point) -> None:
        self._place = (round(SCALE * low[0]), round(SCALE * low[1]))
        far = (round(SCALE * high[0]), round(SCALE * high[1]))
        self._canvas = self.picture.crop((*self._place, *far))

    def end_clip(self) -> None:
        self.picture.paste(self._canvas, self._place)
        self._canvas, self._place = self.picture, (0, 0)

    def _to_pixels(self, points: Sequence[Point]) -> list[Point]:
        left, top = self._place
        return [(SCALE * x - left, SCALE * y - top) for x, y in points]


Pen: TypeAlias = SvgPen | PngPen
