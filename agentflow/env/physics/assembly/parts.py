"""Parts of a block: mass, inertia, surface; and the drive of its joint."""

from __future__ import annotations

from functools import partial
from math import radians

from agentflow.env.constants import Constants
from agentflow.env.physics.assembly.shapes import block_shapes, extents_of
from agentflow.env.physics.model import Drive, Part, Shape
from agentflow.machine.blocks.types import BlockType
from agentflow.machine.geometry.pose import Placed
from agentflow.machine.geometry.vectors import Vec3, add, length, rotation_from_up, scale, subtract

END_RADIUS = 0.1
"""Radius of the ball at each end of a two-ended block, m."""
ROD_DIAMETER = 0.24
"""As a brace is drawn, m."""


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
        shapes=block_shapes(placed, kind, extents, constants["shrink"]),
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
        return extents_of(placed, (across, across, kind.mass * radius * radius / 2))
    x, y, z = (side * side * kind.mass / 12 for side in extents)
    return (y + z, x + z, x + y)


def _ball(mass: float, radius: float) -> Vec3:
    moment = 0.4 * mass * radius * radius
    return (moment, moment, moment)
