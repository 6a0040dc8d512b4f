"""Software renderer: casts one ray per pixel against exact solids and keeps the nearest hit.

Each solid is an intersection of slabs and a quadric, tested only in its bounding rectangle.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from agentflow.env.drawing.cameras import Camera, project
from agentflow.env.rollout import Array
from agentflow.env.rotations import rotated_axes
from agentflow.env.scene import SceneObject
from agentflow.machine.geometry.vectors import Vec3

Grid = NDArray[np.float32]
Triple = tuple[Grid, Grid, Grid]
"""x, y and z in a solid's own frame, in half extents."""
Inks = NDArray[np.uint32]
Mask = NDArray[np.bool_]
Numbers = tuple[float, float, float]

SHADED, LIT = 0.74, 0.3
"""Brightness of a surface parallel to the light, and the gain when it faces the light."""
LEVELS = 64
"""Number of brightness levels of one solid."""
NEAR = 0.1
"""Near clipping distance, m."""
OUTLINE, STEP = 0.6, 0.1
"""Brightness of outlines, and the depth step within a block that gets one (m)."""
THIN = 700
"""Pixels of the picture's height for each pixel of an outline's width."""
OUTLINED = 8
"""Pixels per metre below which solids have no outlines, which would hide their colours."""
BAND = 64
"""Rows drawn at a time, so that they fit into the processor's cache."""
NARROW = 10
"""Focal length, in heights of the picture, from which the eye is so far away that rounding to
single precision shows as noise."""
TINY = 1e-9
"""Keeps rays from being exactly parallel to a side."""
CORNERS = np.array(list(product((-0.5, 0.5), repeat=3)))
EDGES = [(a, b) for a in range(8) for b in range(a + 1, 8) if (a ^ b).bit_count() == 1]
HIDING = 0.003
"""Share of the drawn pixels that scenery must hide to be glass."""
GLASS, EDGE = 0.18, (144, 132, 116)
"""Share of its own colour that glass has, and the colour of its edges."""
FARTHEST = 1e5
"""How far outside the picture edges may end, in pixels."""


@dataclass(frozen=True)
class _Ray:
    """Eye and pixel directions of a rectangle, in a solid's frame and half extents."""

    start: Numbers
    way: Triple
    sun: Array
    half: Array


def draw(
    camera: Camera,
    objects: Sequence[SceneObject],
    ground: Image.Image,
    scenery: Sequence[SceneObject] = (),
) -> Image.Image:
    """Draw objects over the ground; objects with the same name share one outline.

    Args:
        camera: The view.
        objects: Objects to draw.
        ground: Background, RGBA, of the camera's size; so is the result.
        scenery: Further objects, which are as glass with edges where they would hide the others.
    """
    depth = np.full((camera.height, camera.width), np.inf, dtype=np.float32)
    ink = np.zeros(depth.shape, dtype=np.uint32)
    with np.errstate(all="ignore"):  # rays that miss yield nan, which compares false
        for number, item in enumerate(objects, start=1):
            _add(depth, ink, camera, item, number * LEVELS)
        bare = ink == 0
        least = HIDING * float(bare.size - np.count_nonzero(bare))
        glass = [item for item in scenery if _hides(depth, ink, camera, item, least)]
        opaque = [item for item in scenery if item not in glass]
        for number, item in enumerate(opaque, start=len(objects) + 1):
            _add(depth, ink, camera, item, number * LEVELS)
        shown = (*objects, *opaque)
        pixels = _apply_colours(ink, shown, ground)
        names = {name: i for i, name in enumerate(dict.fromkeys(t.name for t in shown), start=1)}
        owners = np.array([0, *(names[item.name] for item in shown)])
        lines = _lines(ink // LEVELS, depth, owners)
        for _ in range(1, round(camera.height / THIN)):
            lines[:-1] |= lines[1:]
            lines[:, :-1] |= lines[:, 1:]
        lines &= depth < camera.focal_length / OUTLINED
        pixels[lines] = (pixels[lines] * (OUTLINE, OUTLINE, OUTLINE, 1.0)).astype(np.uint8)
        for item in glass:
            _tint(pixels, depth, bare, camera, item)
    picture = Image.fromarray(pixels)
    for item in glass:
        _draw_edges(picture, camera, item)
    return picture


def corners_of(item: SceneObject) -> Array:
    """(8, 3) corners of the box around a solid, in the world."""
    corners: Array = CORNERS * _extents(item) @ rotated_axes(item.rotation) + item.position
    return corners


def _extents(item: SceneObject) -> Array:
    """(3,) sides of the box around a solid, in its own frame."""
    return np.array(item.size[:1] * 3 if item.shape == "sphere" else item.size)


def _apply_colours(
    ink: Inks, objects: Sequence[SceneObject], ground: Image.Image
) -> NDArray[np.uint8]:
    """Replace inks (an object's number and brightness) by colours."""
    colours = np.array([(0.0, 0.0, 0.0), *(item.color[:3] for item in objects)])
    table = 255.0 * colours[:, None, :] * np.linspace(0.0, 1.0, LEVELS)[:, None]
    palette = np.full((len(colours) * LEVELS, 4), 255, dtype=np.uint8)
    palette[:, :3] = np.minimum(255.0, table).reshape(-1, 3)
    pixels: NDArray[np.uint8] = np.array(ground)
    packed = pixels.view(np.uint32)[:, :, 0]
    np.copyto(packed, palette.view(np.uint32)[:, 0].take(ink), where=ink > 0)
    return pixels


def _lines(number: Inks, depth: Grid, owners: NDArray[np.int64]) -> Mask:
    """Mask of the outline pixels: where the owner changes, or the depth jumps."""
    lines = np.zeros(number.shape, dtype=np.bool_)
    for down, right in ((1, 0), (0, 1)):
        here, there = np.s_[down:, right:], np.s_[: -down or None, : -right or None]
        rows, columns = np.nonzero(number[here] != number[there])
        one, other = (rows + down, columns + right), (rows, columns)
        changed = owners[number[one]] != owners[number[other]]
        lines[one] |= changed | (np.abs(depth[one] - depth[other]) > STEP)
    return lines


def _add(depth: Grid, ink: Inks, camera: Camera, item: SceneObject, first_ink: int) -> None:
    """Draw one solid where it is the nearest."""
    for place, enter, bright, hit in _surface(camera, item):
        near = depth[place]
        hit &= enter < near
        np.copyto(near, enter, where=hit)
        level = np.clip((LEVELS - 1) * (SHADED + LIT * bright), 0, LEVELS - 1).astype(np.uint32)
        np.copyto(ink[place], level + first_ink, where=hit)


def _hides(depth: Grid, ink: Inks, camera: Camera, item: SceneObject, least: float) -> bool:
    """Whether a solid is in front of more than `least` drawn pixels, or around the eye."""
    if _is_inside(item, camera.eye):
        return True
    hidden = 0
    for place, enter, _, hit in _surface(camera, item):
        hidden += int(np.count_nonzero(hit & (enter < depth[place]) & (ink[place] > 0)))
        if hidden > least:
            return True
    return False


def _tint(
    pixels: NDArray[np.uint8], depth: Grid, bare: Mask, camera: Camera, item: SceneObject
) -> None:
    """Draw one solid as glass over the `bare` pixels behind it, which show none of the objects."""
    colour = 255.0 * np.array([*item.color[:3], 1.0], dtype=np.float32)
    for place, enter, _, hit in _surface(camera, item):
        seen = hit & (enter < depth[place]) & bare[place]
        part = pixels[place]
        part[seen] = ((1.0 - GLASS) * part[seen] + GLASS * colour).astype(np.uint8)


def _draw_edges(picture: Image.Image, camera: Camera, item: SceneObject) -> None:
    """Draw the edges of the box around a solid, above the ground."""
    pen, width = ImageDraw.Draw(picture), max(1, picture.height // 400)
    corners = corners_of(item)
    corners[:, 1] = np.maximum(corners[:, 1], 0.0)
    for a, b in EDGES:
        ends = _in_front(corners[[a, b]], camera)
        if ends is not None and np.abs(places := project(ends, camera)).max() < FARTHEST:
            pen.line(places.ravel().tolist(), fill=EDGE, width=width)


def _in_front(ends: Array, camera: Camera) -> Array | None:
    """The part of a line (2, 3) that is in front of the eye."""
    depths = -(ends - np.asarray(camera.eye)) @ camera.axes[2]
    if depths.max() <= NEAR:
        return None
    if depths.min() < NEAR:
        behind = int(depths.argmin())
        share = (NEAR - depths[behind]) / (depths[1 - behind] - depths[behind])
        ends = ends.copy()
        ends[behind] += share * (ends[1 - behind] - ends[behind])
    return ends


def _is_inside(item: SceneObject, point: Vec3) -> bool:
    """Whether a point is in the box around a solid."""
    away = rotated_axes(item.rotation) @ np.subtract(point, item.position)
    return bool((np.abs(away) <= _extents(item) / 2).all())


def _surface(
    camera: Camera, item: SceneObject
) -> Iterator[tuple[tuple[slice, slice], Grid, Grid, Mask]]:
    """Bands of the picture that a solid can cover, with the distance at which rays enter it, the
    light there, and where they do above the ground and in front of the eye."""
    corners = corners_of(item)
    rows, columns = _rectangle(corners, camera)
    for top in range(rows.start, rows.stop, BAND):
        place = slice(top, min(top + BAND, rows.stop)), columns
        enter, bright = _SHAPES[item.shape](_ray(camera, item, place))
        hit = enter > NEAR
        if corners[:, 1].min() < -NEAR:
            hit &= _above_ground(camera, place[0], enter)
        yield place, enter, bright, hit


def _rectangle(corners: Array, camera: Camera) -> tuple[slice, slice]:
    """Rows and columns that a solid with these corners can cover."""
    places = project(corners, camera)
    if not np.isfinite(places).all():
        return slice(0, camera.height), slice(0, camera.width)
    size = (camera.width, camera.height)
    x0, y0 = np.clip(np.floor(places.min(axis=0)), 0, size)
    x1, y1 = np.clip(np.ceil(places.max(axis=0)) + 1, 0, size)
    return slice(int(y0), int(y1)), slice(int(x0), int(x1))


def _above_ground(camera: Camera, rows: slice, depth: Grid) -> Mask:
    """Mask of the hits above the ground, which hides what is below it."""
    _, up, towards = camera.axes
    rise = (up[1] * _rows(camera, rows) - towards[1]).astype(np.float32)
    above: Mask = depth * rise > -camera.eye[1]
    return above


def _rows(camera: Camera, rows: slice) -> Array:
    """(K, 1) how far above the middle the pixels of these rows look, per metre ahead."""
    numbers = np.arange(rows.start, rows.stop)[:, None]
    return (camera.height / 2 - numbers - 0.5) / camera.focal_length


def _ray(camera: Camera, item: SceneObject, place: tuple[slice, slice]) -> _Ray:
    frame = rotated_axes(item.rotation)
    half = _extents(item) / 2
    right, up, towards = camera.axes
    a, b, c = (frame @ np.subtract(camera.eye, item.position) / half).tolist()
    numbers = np.arange(place[1].start, place[1].stop)
    u = (numbers + 0.5 - camera.width / 2) / camera.focal_length
    v = _rows(camera, place[0])
    ahead, across, upwards = ((frame @ axis / half)[:, None] for axis in (-towards, right, up))
    wide, tall = ahead + TINY + across * u, upwards * v.T
    exact = np.float64 if camera.focal_length > NARROW * camera.height else np.float32
    x, y, z = (wide[i].astype(exact) + tall[i].astype(exact)[:, None] for i in range(3))
    sun = np.asarray(camera.sun)
    return _Ray((a, b, c), (x, y, z), frame @ (sun / np.linalg.norm(sun)), half)


def _slab(start: float, way: Grid) -> tuple[Grid, Grid]:
    """Distances at which rays enter and leave -1..1 on one axis."""
    inverse = 1.0 / way
    middle, reach = -start * inverse, np.abs(inverse)
    return middle - reach, middle + reach


def _quadric(a: Grid, b: Grid, c: float) -> tuple[Grid, Grid]:
    """Roots of a t^2 + 2 b t + c, ascending where a > 0; nan without real roots."""
    root = np.sqrt(b * b - a * c)
    return (-b - root) / a, (-b + root) / a


def _hit_distance(enter: Grid, leave: Grid) -> Grid:
    """Distance at which rays enter; infinite where they miss."""
    return np.where(enter <= leave, enter, np.float32(np.inf))


def _light_cosine(ray: _Ray, normal: tuple[Grid | float, Grid | float, Grid | float]) -> Grid:
    """Cosine between the light and a surface normal given in half extents."""
    x, y, z = (part / half for part, half in zip(normal, ray.half, strict=True))
    along = x * ray.sun[0] + y * ray.sun[1] + z * ray.sun[2]
    return np.asarray(along / np.sqrt(x * x + y * y + z * z + 1e-12), dtype=np.float32)


def _box(ray: _Ray) -> tuple[Grid, Grid]:
    slabs = [_slab(start, way) for start, way in zip(ray.start, ray.way, strict=True)]
    (x, x_out), (y, y_out), (z, z_out) = slabs
    enter = np.maximum(np.maximum(x, y), z)
    leave = np.minimum(np.minimum(x_out, y_out), z_out)
    lights = (np.sign(ray.start) * ray.sun).astype(np.float32)
    bright = np.where(enter == x, lights[0], np.where(enter == y, lights[1], lights[2]))
    return _hit_distance(enter, leave), bright


def _sphere(ray: _Ray) -> tuple[Grid, Grid]:
    (a, b, c), (x, y, z) = ray.start, ray.way
    enter, leave = _quadric(
        x * x + y * y + z * z, a * x + b * y + c * z, a * a + b * b + c * c - 1.0
    )
    normal = (a + enter * x, b + enter * y, c + enter * z)
    return _hit_distance(enter, leave), _light_cosine(ray, normal)


def _capped(ray: _Ray, side: Grid, side_out: Grid, rise: Grid | float) -> tuple[Grid, Grid]:
    """A solid of revolution cut off at y = -1 and 1; `rise` is the y of its side's normal."""
    (a, b, c), (x, y, z) = ray.start, ray.way
    cap, cap_out = _slab(b, y)
    lit = _light_cosine(ray, (a + side * x, rise, c + side * z))
    bright = np.where(side > cap, lit, np.float32(np.sign(b) * ray.sun[1]))
    return _hit_distance(np.maximum(side, cap), np.minimum(side_out, cap_out)), bright


def _cylinder(ray: _Ray) -> tuple[Grid, Grid]:
    (a, _, c), (x, _, z) = ray.start, ray.way
    return _capped(ray, *_quadric(x * x + z * z, a * x + c * z, a * a + c * c - 1.0), 0.0)


def _cone(ray: _Ray) -> tuple[Grid, Grid]:
    """Cone with its tip at y = 1; rays steeper than its side never leave it past the tip."""
    (a, b, c), (x, y, z) = ray.start, ray.way
    left, shrink = (1.0 - b) * 0.5, y * -0.5
    steepness = x * x + z * z - shrink * shrink
    first, second = _quadric(steepness, a * x + c * z - left * shrink, a * a + c * c - left * left)
    low, high = np.fmin(first, second), np.fmax(first, second)
    endless = np.float32(np.inf)
    side = np.where(steepness > 0, low, np.where(y < 0, high, -endless))
    side_out = np.where(steepness > 0, high, np.where(y < 0, endless, low))
    return _capped(ray, side, side_out, (1.0 - b - side * y) * 0.25)


_SHAPES = {"box": _box, "sphere": _sphere, "cylinder": _cylinder, "cone": _cone}
