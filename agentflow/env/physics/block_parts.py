"""Owns what each block type is made of: shapes, surfaces, inertia, joint and motor (spec 2.2).

How blocks hang together is assembly.py's.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from math import pi

from agentflow.env.constants import Constants
from agentflow.env.physics.model import Color, Drive, JointKind, Part, Shape
from agentflow.env.physics.vectors import add, length, scale, subtract, upright_to
from agentflow.env.scene import Vec3
from agentflow.machine.blocks.library import BRACE, CONTAINER, DECOUPLER, GRABBER, SUSPENSION
from agentflow.machine.blocks.plates import HOLE, Plate, plate_of
from agentflow.machine.blocks.types import BlockType
from agentflow.machine.geometry.placement import Placed

ROUND = frozenset({2, 38, 39, 40, 46, 51, 60})
"""Wheels and cogs: cylinders about their Front axis."""
TURNING = frozenset({13, 19, 22})
"""Joints that turn about their Front axis: round too, so that they clear their neighbours."""
BALLS = frozenset({36, 44})
HINGE = 5
STEERING_HINGE = 28
WALL = 0.2
"""Thickness of a container's floor and walls, m."""
HINGE_PLATE = 0.3
"""Thickness of hinges across their swing, m: a full box would jam on its parent's neighbours."""
END_RADIUS = 0.1
"""Of the little ball at each end of a two-ended block, m."""

_JOINTS: dict[int, tuple[JointKind, str]] = {
    HINGE: ("revolute", "right"),
    STEERING_HINGE: ("revolute", "up"),
    SUSPENSION: ("prismatic", "front"),
    44: ("spherical", "front"),
    76: ("spherical", "front"),
    **dict.fromkeys(ROUND | TURNING, ("revolute", "front")),
}

_COLORS: dict[str, Color] = {
    "Root": (0.85, 0.66, 0.2, 1.0),
    "Structure": (0.66, 0.47, 0.29, 1.0),
    "Wheel": (0.24, 0.25, 0.28, 1.0),
    "Joint": (0.45, 0.55, 0.62, 1.0),
    "Powered joint": (0.78, 0.33, 0.2, 1.0),
    "Elastic connector": (0.35, 0.6, 0.3, 1.0),
    "Support": (0.45, 0.55, 0.62, 1.0),
    "Payload": (0.5, 0.5, 0.52, 1.0),
    "Weight": (0.3, 0.32, 0.4, 1.0),
    "Contact": (0.3, 0.5, 0.45, 1.0),
    "Interaction": (0.6, 0.4, 0.6, 1.0),
    "Flight": (0.55, 0.7, 0.85, 1.0),
    "Gear": (0.7, 0.65, 0.4, 1.0),
    "Plate": (0.56, 0.6, 0.62, 1.0),
}


def kind_of(block_type: int) -> tuple[JointKind, str]:
    """How a block moves against its parent, and the name of its own axis about which it does."""
    return _JOINTS.get(block_type, ("fixed", "front"))


def drive_of(placed: Placed, kind: BlockType, constants: Constants) -> Drive:
    """Motor, spring-damper and stops of a block's joint, by spec 1.8, 2.1 and 2.2."""
    speed = constants.of("motor_speed", kind.type)
    torque = constants.of("motor_torque", kind.type)
    friction = constants.of("joint_friction", kind.type)
    if kind.type == DECOUPLER:
        return Drive(starts="decouplers")
    if kind.type == SUSPENSION:
        return Drive(
            stiffness=constants["suspension_stiffness"],
            damping=constants["suspension_damping"],
            stops=(constants["suspension_low"], constants["suspension_high"]),
        )
    if kind.type == HINGE:
        return Drive(stops=(-pi / 2, pi / 2), friction=friction)
    if kind.type == STEERING_HINGE:  # to its Left, which is a negative turn about Up
        return Drive(-speed, torque, starts="steering_hinges", stops=(-pi / 2, pi / 2))
    if kind.powered_wheel and placed.facing == "x-":
        return Drive(-speed, torque)
    return Drive(speed, torque, friction=friction)


def whole_part(placed: Placed, kind: BlockType, constants: Constants, shift: Vec3) -> Part:
    """The part of a block that is one rigid piece."""
    extents = subtract(placed.box_max, placed.box_min)
    return _part(
        placed,
        kind,
        constants,
        centre=add(placed.center, shift),
        mass=kind.mass,
        inertia=_inertia(placed, kind, extents),
        shapes=_shapes(placed, kind, extents, constants["shrink"]),
        extents=extents if kind.blade is None else (0.0, 0.0, 0.0),
    )


def caster_parts(
    placed: Placed, kind: BlockType, constants: Constants, shift: Vec3
) -> tuple[Part, Part, Vec3]:
    """Fork and wheel of a small or roller wheel, and the hub about which the wheel rolls."""
    assert kind.size is not None
    radius = kind.size[1] / 2 - constants["shrink"]
    forward, up = placed.front, placed.up
    origin = add(placed.origin, shift)
    hub = add(origin, scale(forward, kind.size[2] - radius))
    hub = add(hub, scale(up, -constants["caster_trail"]))
    stem = scale(subtract(hub, origin), 0.5)
    width = 0.8 * kind.size[0]
    fork = _part(
        placed,
        kind,
        constants,
        centre=add(origin, stem),
        mass=0.3 * kind.mass,
        inertia=_ball(0.3 * kind.mass, radius),
        shapes=(
            Shape(
                "box", (0.15, max(2 * length(stem), 0.1), 0.15), (0, 0, 0), upright_to(stem), False
            ),
        ),
    )
    rim = Shape("cylinder", (2 * radius, width, 2 * radius), rotation=upright_to(placed.right))
    size = (kind.size[2], kind.size[1], width)
    wheel = _part(
        placed,
        kind,
        constants,
        centre=hub,
        mass=0.7 * kind.mass,
        inertia=_ball(0.7 * kind.mass, radius),
        shapes=(rim,),
        extents=(size[1], size[1], size[1]),
    )
    return fork, wheel, hub


def end_parts(
    placed: Placed, kind: BlockType, constants: Constants, shift: Vec3
) -> tuple[Part, Part]:
    """The two ends of a brace, spring or winch, half its mass each; they touch nothing."""
    assert placed.end_a is not None
    assert placed.end_b is not None
    ends = (add(placed.end_a, shift), add(placed.end_b, shift))
    ball = Shape("sphere", (2 * END_RADIUS,) * 3, solid=False)
    line = subtract(ends[1], ends[0])
    rods: tuple[Shape, ...] = ()
    if kind.type == BRACE and length(line) > END_RADIUS:
        rods = (
            Shape(
                "cylinder",
                (0.24, length(line), 0.24),
                scale(line, 0.5),
                upright_to(line),
                solid=False,
            ),
        )
    first, second = (
        _part(
            placed,
            kind,
            constants,
            centre=end,
            mass=0.5 * kind.mass,
            inertia=_ball(0.5 * kind.mass, END_RADIUS),
            shapes=(ball, *more),
        )
        for end, more in zip(ends, (rods, ()), strict=True)
    )
    return first, second


def _part(
    placed: Placed,
    kind: BlockType,
    constants: Constants,
    *,
    centre: Vec3,
    mass: float,
    inertia: Vec3,
    shapes: tuple[Shape, ...],
    extents: Vec3 = (0.0, 0.0, 0.0),
) -> Part:
    return Part(
        block=placed.id,
        centre=centre,
        mass=mass,
        inertia=inertia,
        shapes=shapes,
        friction=constants.of("friction", kind.type),
        restitution=constants.of("restitution", kind.type),
        rolling_friction=constants.of("rolling_friction", kind.type),
        linear_drag=kind.linear_drag,
        angular_drag=kind.angular_drag,
        extents=extents,
        color=_COLORS[kind.category],
    )


def _shapes(placed: Placed, kind: BlockType, extents: Vec3, shrink: float) -> tuple[Shape, ...]:
    """Collision shapes, smaller by `shrink` on each side so that touching faces do not rub."""
    if kind.type == CONTAINER:
        return _container(placed, kind, shrink)
    if plate := plate_of(kind.type):
        return tuple(_strips(plate, extents, shrink))
    small: Vec3 = (extents[0] - 2 * shrink, extents[1] - 2 * shrink, extents[2] - 2 * shrink)
    if kind.type in BALLS:
        return (Shape("sphere", small),)
    if kind.type in ROUND | TURNING:
        assert kind.size is not None
        width = kind.size[0] - 2 * shrink
        flat = (width, kind.size[2] - 2 * shrink, width)
        return (Shape("cylinder", flat, rotation=upright_to(placed.front)),)
    if kind.type in (HINGE, STEERING_HINGE):
        thin = placed.up if kind.type == HINGE else placed.right
        x, y, z = (HINGE_PLATE if axis else side for axis, side in zip(thin, small, strict=True))
        return (Shape("box", (x, y, z)),)
    if kind.type == GRABBER:  # its front juts out to meet what was placed against it
        longer = _turned_size(placed, (0.0, 0.0, 2 * shrink))
        return (Shape("box", add(small, longer), scale(placed.front, shrink)),)
    return (Shape("box", small),)


def _container(placed: Placed, kind: BlockType, shrink: float) -> tuple[Shape, ...]:
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
    return tuple(
        Shape("box", _turned_size(placed, size), _turned(placed, (at[0], at[1], at[2] - z / 2)))
        for size, at in boxes
    )


def _strips(plate: Plate, extents: Vec3, shrink: float) -> Iterator[Shape]:
    """A plate cut along x at the rims of its holes, and along z within each strip."""
    edge, thick = plate.size / 2 - shrink, extents[1] - 2 * shrink
    rims = {-edge, edge, *(z + rim for _, z in plate.centres for rim in (-HOLE / 2, HOLE / 2))}
    for low, high in pairwise(sorted(rims)):
        middle = (low + high) / 2
        missing = [x for x, z in plate.centres if abs(z - middle) < HOLE / 2]
        ends = [-edge, *(x + rim for x in sorted(missing) for rim in (-HOLE / 2, HOLE / 2)), edge]
        for left, right in zip(ends[::2], ends[1::2], strict=True):
            size = (right - left, thick, high - low)
            yield Shape("box", size, ((left + right) / 2, 0.0, middle))


def _turned(placed: Placed, local: Vec3) -> Vec3:
    """A vector of the block's own frame in the machine frame."""
    right, up, forward = placed.right, placed.up, placed.front
    return add(add(scale(right, local[0]), scale(up, local[1])), scale(forward, local[2]))


def _turned_size(placed: Placed, size: Vec3) -> Vec3:
    x, y, z = _turned(placed, size)
    return (abs(x), abs(y), abs(z))


def _inertia(placed: Placed, kind: BlockType, extents: Vec3) -> Vec3:
    if kind.type in BALLS:
        return _ball(kind.mass, extents[0] / 2)
    if kind.type in ROUND | TURNING:
        assert kind.size is not None
        radius, width = kind.size[0] / 2, kind.size[2]
        across = kind.mass * (3 * radius * radius + width * width) / 12
        return _turned_size(placed, (across, across, kind.mass * radius * radius / 2))
    x, y, z = (side * side * kind.mass / 12 for side in extents)
    return (y + z, x + z, x + y)


def _ball(mass: float, radius: float) -> Vec3:
    moment = 0.4 * mass * radius * radius
    return (moment, moment, moment)
