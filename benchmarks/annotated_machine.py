"""Draws the annotated machine of the first tutorial: a car that gets its last wheel, as SVG.

python benchmarks/annotated_machine.py [docs/pictures/machine-annotated.svg]
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from itertools import chain
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent))

from agentflow.env.drawing.cameras import Camera, View, camera_at, fit, project
from agentflow.env.drawing.raster import corners_of
from agentflow.env.drawing.solids import SPOKE, MachineSolids
from agentflow.env.rollout import Array
from agentflow.env.rotations import rotated_axes
from agentflow.env.scene import SceneObject
from agentflow.machine import ROOT, Machine, Step, place

OUT = Path("docs/pictures/machine-annotated.svg")
MACHINE = Machine(
    (
        ROOT,
        Step(1, 1, 0, 0),
        Step(2, 1, 0, 1),
        Step(3, 2, 1, 1),
        Step(4, 2, 1, 3),
        Step(5, 2, 2, 1),
        Step(6, 2, 2, 3),
        Step(7, 9, 0, 4, 2, 6),
    )
)
"""The car of the tutorial, with a spring."""
FRONT, NEXT, SPRING = 1, 4, 7
"""The block whose faces have numbers, the wheel that it gets next, and the spring."""
EYE = (0.78, 0.55, 0.5)
"""Direction from the machine to the eye."""
WIDTH, HEIGHT = 480, 388
"""Size of the picture, in points."""
SHIFT = np.array((-34.0, -4.0))
"""How far the machine is from the middle of the picture, in points."""
SIDES = 40
"""Sides of the polygon that stands for a circle."""
RADIUS = 10
"""Radius of the circle around a number, in points."""
SUN = np.array((0.35, 0.85, 0.4))
"""Direction towards the light."""
STYLE = """
.paper { fill: #fff } .text { fill: #1f2328 } .lead { stroke: #57606a }
.arrow { stroke: #c01822; fill: #c01822 } .axis { stroke: #57606a; fill: #57606a }
.next { fill: none; stroke: #57606a; stroke-width: 1.5; stroke-dasharray: 5 4 }
text { font: 15px system-ui, sans-serif; stroke: none }
@media (prefers-color-scheme: dark) {
.paper { fill: #0d1117 } .text { fill: #e6edf3 } .lead, .next { stroke: #9aa4af }
.arrow { stroke: #ff6b70; fill: #ff6b70 } .axis { stroke: #9aa4af; fill: #9aa4af } }
"""
AXES = {"z+ forward": (0, 0, 1), "y+ up": (0, 1, 0), "x+ right": (1, 0, 0)}


def main() -> None:
    """Write the picture."""
    out = Path(sys.argv[1]) if len(sys.argv) > 1 else OUT
    out.write_text(drawn(), encoding="utf-8")


def drawn() -> str:
    """The whole SVG document."""
    solids = MachineSolids(MACHINE)
    geometry = {block.id: block for block in place(MACHINE).blocks}
    lift = solids.rest.centre[0] - np.asarray(geometry[0].center)
    objects = [item for item in solids.objects(solids.rest) if item.color != SPOKE]
    camera = look(objects)

    def seen(point: Sequence[float], ahead: Sequence[float] = (0, 0, 0)) -> Array:
        """A point of the machine in the picture."""
        return pixels(np.add(point, lift)[None] + ahead, camera)[0]

    front, wheel, spring = geometry[FRONT], geometry[NEXT], geometry[SPRING]
    faces = [face for face in front.faces if turned_to(face.facing, EYE)]
    assert spring.end_a is not None
    assert spring.end_b is not None
    marks = [(str(face.face_id), seen(face.position)) for face in faces]
    marks += [("a", seen(spring.end_a)), ("b", seen(spring.end_b))]
    start, end = seen(wheel.origin), seen(wheel.origin, (1.5, 0, 0))
    middles = {block.id: seen(block.center) for block in geometry.values() if not block.two_ended}
    built = [item for item in objects if item.name != f"block {NEXT}"]
    (planned,) = (item for item in objects if item not in built)
    rod = (seen(spring.end_a) + seen(spring.end_b)) / 2
    labels = (
        label("Spring: joins two faces, a and b", (70, 24)) + lead((190, 30), rod),
        label("Starting Block", (236, 52)) + lead((280, 58), middles[0] + np.array((4, -38))),
        label("Wooden Block", (340, 98)) + lead((370, 104), seen(front.center, (-0.2, 0.5, 0.6))),
        label("Powered Wheel", (14, 268)) + lead((50, 254), middles[6] + np.array((-34, 8))),
        label("building point:", (310, 318)) + lead((306, 312), start + np.array((9, 10))),
        label("the middle of face 3", (310, 336)),
        label("facing: where the", (190, 360)) + lead((204, 345), end + np.array((1, 4))),
        label("wheel will point", (190, 378)),
    )
    return document(
        (
            *chain.from_iterable(drawn_solid(s, camera) for s in back_to_front(built, camera)),
            outline(planned, camera),
            arrow(start, end, "arrow"),
            *(mark(point, words) for words, point in marks),
            *labels,
            *compass(camera),
        )
    )


def look(solids: Sequence[SceneObject]) -> Camera:
    """A camera with all solids in the picture."""
    view = View(back=EYE, size=(WIDTH, HEIGHT), fill=0.74)
    return camera_at(*fit(np.concatenate([corners_of(solid) for solid in solids]), view), view)


def pixels(points: Array, camera: Camera) -> Array:
    """Points of the world in the picture."""
    shown: Array = project(points, camera) + SHIFT
    return shown


def turned_to(facing: str, eye: Sequence[float]) -> bool:
    """Whether a face looks towards the eye: "x+" does if the eye is on that side."""
    return bool(eye["xyz".index(facing[0])] * (1 if facing[1] == "+" else -1) > 0)


def compass(camera: Camera) -> Iterator[str]:
    """The three axes, in the lower left corner."""
    corner = np.array((52.0, 322.0))
    middle = np.asarray(camera.target)
    for words, axis in AXES.items():
        along = np.diff(project(np.stack([middle, middle + axis]), camera), axis=0)[0]
        end = corner + 34 * along / np.linalg.norm(along)
        yield arrow(corner, end, "axis")
        x, y = end
        yield label(words, (x + 6, y + 9) if "right" not in words else (x - 14, y + 17))


def sides_of(solid: SceneObject) -> Iterator[Array]:
    """The polygons around a box or a cylinder (its axis is y), their corners in the world."""
    half = np.asarray(solid.size) / 2
    if solid.shape == "box":
        square = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
        local = [np.insert(square, i, s, axis=1) for i in range(3) for s in (-1, 1)]
    else:
        turn = np.linspace(0, 2 * np.pi, SIDES, endpoint=False)
        rim = np.stack([np.cos(turn), np.zeros(SIDES), np.sin(turn)], axis=1)
        low, high = rim - np.eye(3)[1], rim + np.eye(3)[1]
        strips = zip(low, high, np.roll(high, -1, axis=0), np.roll(low, -1, axis=0), strict=True)
        local = [low, high, *(np.array(strip) for strip in strips)]
    for polygon in local:
        yield polygon * half @ rotated_axes(solid.rotation) + solid.position


def back_to_front(solids: Sequence[SceneObject], camera: Camera) -> list[SceneObject]:
    """Farthest first, by their centres."""
    return sorted(solids, key=lambda s: -float(np.linalg.norm(np.subtract(s.position, camera.eye))))


def drawn_solid(solid: SceneObject, camera: Camera) -> Iterator[str]:
    """Its sides that are turned to the eye, shaded."""
    for corners in sides_of(solid):
        middle = corners.mean(axis=0)
        normal = np.cross(corners[1] - corners[0], corners[2] - corners[1])
        normal *= np.sign(normal @ (middle - solid.position)) / np.linalg.norm(normal)
        if normal @ (camera.eye - middle) > 0:
            light = 0.72 + 0.28 * float(normal @ SUN)
            paint = "#" + "".join(
                f"{round(min(255, 255 * light * c)):02x}" for c in solid.color[:3]
            )
            curved = solid.shape == "cylinder" and len(corners) == 4
            edge = paint if curved else "#2b2118"
            yield f'<polygon points="{path(corners, camera)}" fill="{paint}" stroke="{edge}"/>'


def outline(solid: SceneObject, camera: Camera) -> str:
    """The rims of a wheel."""
    rims = [corners for corners in sides_of(solid) if len(corners) == SIDES]
    return "".join(f'<polygon class="next" points="{path(rim, camera)}"/>' for rim in rims)


def path(corners: Array, camera: Camera) -> str:
    """The corners of a polygon as SVG has them."""
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in pixels(corners, camera))


def arrow(start: Array, end: Array, kind: str) -> str:
    """An arrow of a class of the style sheet."""
    along = (end - start) / np.linalg.norm(end - start)
    across = np.array((-along[1], along[0]))
    head = (end, end - 11 * along + 5 * across, end - 11 * along - 5 * across)
    (x, y), (u, v) = start, end - 8 * along
    points = " ".join(f"{a:.1f},{b:.1f}" for a, b in head)
    return (
        f'<g class="{kind}"><path d="M{x:.1f} {y:.1f}L{u:.1f} {v:.1f}" stroke-width="3"/>'
        f'<polygon points="{points}"/></g>'
    )


def mark(point: Array, words: str) -> str:
    """A number or letter in a circle."""
    x, y = point
    return (
        f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{RADIUS}" fill="#fff" stroke="#1f2328"/>'
        f'<text x="{x:.1f}" y="{y + 5:.1f}" text-anchor="middle" fill="#1f2328">{words}</text>'
    )


def label(words: str, at: tuple[float, float]) -> str:
    """Words that begin at a point of the picture."""
    return f'<text class="text" x="{at[0]:.1f}" y="{at[1]:.1f}">{words}</text>'


def lead(start: tuple[float, float], end: Array) -> str:
    """A thin line from a label to what it names."""
    (x, y), (u, v) = start, end
    return f'<path class="lead" d="M{x:.1f} {y:.1f}L{u:.1f} {v:.1f}"/>'


def document(body: Sequence[str]) -> str:
    """An SVG document, which has light and dark colours of its own."""
    about = (
        "A car whose front right wheel is not attached yet; the faces of one block are numbered."
    )
    lines = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" '
        f'height="{HEIGHT}" role="img" aria-label="{about}" stroke-linejoin="round">',
        f"<style>{STYLE}</style>",
        f'<rect class="paper" width="{WIDTH}" height="{HEIGHT}" rx="8"/>',
        *body,
        "</svg>",
    )
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
