"""Parts of a block: mass, inertia, surface and collision shapes; and the drive of its joint."""

from collections.abc import Iterator
from functools import partial
from itertools import pairwise
from math import radians

from agentflow.env.constants import Constants
from agentflow.env.physics.model import Drive, Part, Shape
from agentflow.machine.blocks.types import DIRECTIONS, HOLE, BlockType, plate_of
from agentflow.machine.geometry.pose import Placed
from agentflow.machine.geometry.vectors import (
    Vec3,
    add,
    cross,
    length,
    rotation_from_up,
    scale,
    subtract,
)

END_RADIUS = 0.1
"""Radius of the ball at each end of a two-ended block, m."""
ROD_DIAMETER = 0.24
"""As a brace is drawn, m."""
WALL = 0.2
"""Thickness of a container's floor and walls, m."""
HINGE_PLATE = 0.3
"""Thickness of hinges across their swing, m: a full box would jam on its parent's neighbours."""


def joint_drive(placed: Placed, kind: BlockType, constants: Constants) -> Drive:
    """Motor, spring-damper, friction and stops of a block's joint to its parent."""
    joint, stops = kind.joint, None
    sprung = joint.kind == "prismatic"
    if sprung:
        stops = (constants["suspension_low"], constants["suspension_high"])
    elif joint.stops_deg is not None:
        stops = (radians(joint.stops_deg[0]), radians(joint.stops_deg[1]))
    reverse = kind.powered_wheel and placed.facing == "x-"
    return Drive(
        speed=constants.of("motor_speed", kind.type) * joint.motor_sense * (-1 if reverse else 1),
        torque=constants.of("motor_torque", kind.type),
        starts=joint.switch,
        friction=constants.of("joint_friction", kind.type),
        stiffness=constants["suspension_stiffness"] if sprung else 0.0,
        damping=constants["suspension_damping"] if sprung else 0.0,
        stops=stops,
    )


def block_parts(placed: Placed, kind: BlockType, constants: Constants, shift: Vec3) -> list[Part]:
    """The parts of a block with one parent: one, or fork and wheel of a caster.

    `shift` leads from the machine frame to the world, m.
    """
    if kind.shape == "caster":
        return _caster_parts(placed, kind, constants, shift)
    extents = subtract(placed.box_max, placed.box_min)
    part = _part_of(placed, kind, constants)
    block = part(
        centre=add(placed.center, shift),
        mass=kind.mass,
        inertia=_inertia(placed, kind, extents),
        shapes=_block_shapes(placed, kind, extents, constants["shrink"]),
        extents=extents if kind.blade is None else (0.0, 0.0, 0.0),
    )
    return [block]


def _caster_parts(placed: Placed, kind: BlockType, constants: Constants, shift: Vec3) -> list[Part]:
    """Fork and wheel of a small or roller wheel; the wheel's centre is its hub."""
    assert kind.size is not None
    radius = kind.size[1] / 2 - constants["shrink"]
    origin = add(placed.origin, shift)
    hub = add(origin, scale(placed.front, kind.size[2] - radius))
    hub = add(hub, scale(placed.up, -constants["caster_trail"]))
    stem = scale(subtract(hub, origin), 0.5)
    width, height = 0.8 * kind.size[0], kind.size[1]
    bar = (0.15, max(2 * length(stem), 0.1), 0.15)
    part = _part_of(placed, kind, constants)
    fork = part(
        centre=add(origin, stem),
        mass=0.3 * kind.mass,
        inertia=_ball(0.3 * kind.mass, radius),
        shapes=(Shape("box", bar, rotation=rotation_from_up(stem), solid=False),),
    )
    rim = Shape(
        "cylinder", (2 * radius, width, 2 * radius), rotation=rotation_from_up(placed.right)
    )
    wheel = part(
        centre=hub,
        mass=0.7 * kind.mass,
        inertia=_ball(0.7 * kind.mass, radius),
        shapes=(rim,),
        extents=(height, height, height),
    )
    return [fork, wheel]


def end_parts(placed: Placed, kind: BlockType, constants: Constants, shift: Vec3) -> list[Part]:
    """The two ends of a two-ended block, half its mass each; they collide with nothing."""
    assert placed.end_a is not None
    assert placed.end_b is not None
    ends = (add(placed.end_a, shift), add(placed.end_b, shift))
    ball = Shape("sphere", (2 * END_RADIUS,) * 3, solid=False)
    line = subtract(ends[1], ends[0])
    rods: tuple[Shape, ...] = ()
    if kind.connector == "rod" and length(line) > END_RADIUS:
        size = (ROD_DIAMETER, length(line), ROD_DIAMETER)
        rods = (Shape("cylinder", size, scale(line, 0.5), rotation_from_up(line), solid=False),)
    part = _part_of(placed, kind, constants)
    return [
        part(
            centre=end,
            mass=0.5 * kind.mass,
            inertia=_ball(0.5 * kind.mass, END_RADIUS),
            shapes=(ball, *more),
        )
        for end, more in zip(ends, (rods, ()), strict=True)
    ]


def _part_of(placed: Placed, kind: BlockType, constants: Constants) -> partial[Part]:
    """A part of a block, with the surface and drag of its type."""
    return partial(
        Part,
        block=placed.id,
        friction=constants.of("friction", kind.type),
        restitution=constants.of("restitution", kind.type),
        rolling_friction=constants.of("rolling_friction", kind.type),
        linear_drag=kind.linear_drag,
        angular_drag=kind.angular_drag,
        color=kind.color,
    )


def _inertia(placed: Placed, kind: BlockType, extents: Vec3) -> Vec3:
    """Principal moments of a homogeneous ball, cylinder about Front, or box."""
    if kind.shape == "sphere":
        return _ball(kind.mass, extents[0] / 2)
    if kind.shape == "cylinder":
        assert kind.size is not None
        radius, width = kind.size[0] / 2, kind.size[2]
        across = kind.mass * (3 * radius * radius + width * width) / 12
        return _extents_of(placed, (across, across, kind.mass * radius * radius / 2))
    x, y, z = (side * side * kind.mass / 12 for side in extents)
    return (y + z, x + z, x + y)


def _ball(mass: float, radius: float) -> Vec3:
    moment = 0.4 * mass * radius * radius
    return (moment, moment, moment)


def _block_shapes(
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
        longer = _extents_of(placed, scale(DIRECTIONS[kind.grip_direction], 2 * shrink))
        return (Shape("box", add(small, longer), scale(front, shrink)),)
    return (Shape("box", small),)


def _extents_of(placed: Placed, size: Vec3) -> Vec3:
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
        yield Shape("box", _extents_of(placed, size), place)


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
