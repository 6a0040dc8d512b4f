"""Collision shapes of a block that is one rigid body."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

from agentflow.env.physics.model import Shape
from agentflow.machine.blocks.plates import HOLE, plate_of
from agentflow.machine.blocks.types import DIRECTIONS, BlockType
from agentflow.machine.geometry.pose import Placed
from agentflow.machine.geometry.vectors import Vec3, add, cross, rotation_from_up, scale

WALL = 0.2
"""Thickness of a container's floor and walls, m."""
HINGE_PLATE = 0.3
"""Thickness of hinges across their swing, m: a full box would jam on its parent's neighbours."""


def block_shapes(
    placed: Placed, kind: BlockType, extents: Vec3, shrink: float
) -> tuple[Shape, ...]:
    """Shapes of a block that is one rigid body, by the `shape` of its type.

    Its box has these `extents` in the machine frame, m. Shapes are smaller by `shrink` (m) on each
    side, which keeps touching faces from rubbing.
    """
    x, y, z = (side - 2 * shrink for side in extents)
    small = (x, y, z)
    match kind.shape:
        case "sphere":
            return (Shape("sphere", small),)
        case "cylinder":
            return (_cylinder(placed, kind, shrink),)
        case "hinge":
            return (_hinge(placed, kind, small),)
        case "container":
            return tuple(_container(placed, kind, shrink))
        case "plate":
            return tuple(_plate(kind, shrink, small[1]))
    if kind.grip_direction is not None:  # juts out to meet what was placed against it
        front = placed.direction(kind.grip_direction)
        longer = extents_of(placed, scale(DIRECTIONS[kind.grip_direction], 2 * shrink))
        return (Shape("box", add(small, longer), scale(front, shrink)),)
    return (Shape("box", small),)


def extents_of(placed: Placed, size: Vec3) -> Vec3:
    """Extents along the machine's axes of a box that lies along the block's own axes."""
    x, y, z = placed.turn(size)
    return (abs(x), abs(y), abs(z))


def _cylinder(placed: Placed, kind: BlockType, shrink: float) -> Shape:
    assert kind.size is not None
    width = kind.size[0] - 2 * shrink
    size = (width, kind.size[2] - 2 * shrink, width)
    return Shape("cylinder", size, rotation=rotation_from_up(placed.front))


def _hinge(placed: Placed, kind: BlockType, small: Vec3) -> Shape:
    thin = cross(placed.direction(kind.joint.axis), placed.front)
    x, y, z = (HINGE_PLATE if across else side for across, side in zip(thin, small, strict=True))
    return Shape("box", (x, y, z))


def _container(placed: Placed, kind: BlockType, shrink: float) -> Iterator[Shape]:
    """Stem, floor under face 0 and four walls; open on Front."""
    assert kind.size is not None
    x, y, z = kind.size
    floor = kind.faces[0].position[2]
    x, y = x - 2 * shrink, y - 2 * shrink
    tall = z - floor
    boxes: tuple[tuple[Vec3, Vec3], ...] = (
        (
            (1.0 - 2 * shrink, 1.0 - 2 * shrink, floor - WALL - shrink),
            (0, 0, (floor - WALL + shrink) / 2),
        ),
        ((x, y, WALL), (0, 0, floor - WALL / 2)),
        ((WALL, y, tall), ((x - WALL) / 2, 0, floor + tall / 2)),
        ((WALL, y, tall), ((WALL - x) / 2, 0, floor + tall / 2)),
        ((x, WALL, tall), (0, (y - WALL) / 2, floor + tall / 2)),
        ((x, WALL, tall), (0, (WALL - y) / 2, floor + tall / 2)),
    )
    for size, at in boxes:
        place = placed.turn((at[0], at[1], at[2] - z / 2))
        yield Shape("box", extents_of(placed, size), place)


def _plate(kind: BlockType, shrink: float, thick: float) -> Iterator[Shape]:
    """A plate cut along x at the rims of its holes, and along z within each strip."""
    plate = plate_of(kind.type)
    assert plate is not None
    edge = plate.size / 2 - shrink
    rims = {-edge, edge, *(z + rim for _, z in plate.hole_centres for rim in (-HOLE / 2, HOLE / 2))}
    for low, high in pairwise(sorted(rims)):
        middle = (low + high) / 2
        missing = [x for x, z in plate.hole_centres if abs(z - middle) < HOLE / 2]
        ends = [-edge, *(x + rim for x in sorted(missing) for rim in (-HOLE / 2, HOLE / 2)), edge]
        for left, right in zip(ends[::2], ends[1::2], strict=True):
            size = (right - left, thick, high - low)
            yield Shape("box", size, ((left + right) / 2, 0.0, middle))
