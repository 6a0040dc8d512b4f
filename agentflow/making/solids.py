"""Watertight bodies of parts, and pegs that hold them together; manifold3d does the geometry.

Millimetres of the made machine, in the frame of `parts`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from manifold3d import Manifold, OpType

from agentflow.env.physics.frames import swap, swap_quaternion
from agentflow.env.physics.model import Shape
from agentflow.env.rollout import Array
from agentflow.env.rotations import rotated_axes
from agentflow.errors import UsageError
from agentflow.machine.blocks.library import library
from agentflow.machine.geometry.placement import Geometry
from agentflow.machine.geometry.vectors import Quat, Vec3, add, rotation_from_up
from agentflow.making.parts import Part, shift_of

SEGMENTS = 180
"""Sides of round bodies: their volume differs by less than 0.1 %."""
TOUCH = 2e-5
"""By how much shapes that become one body are larger on each side, m: what touches, joins."""
CLEARANCE, DEEPER = 0.1, 0.2
"""Gap around a peg, and beyond its end, mm."""
WALL = 0.8
"""Least thickness of what is around a peg or a hole, mm: two lines of a printer."""
FILLED = 0.9
"""Share of these walls that must be there; those of round blocks are a little lower."""


def body(part: Part, scale: float, grown: float = 0.0) -> Any:
    """A part where it goes; `scale` is mm per m, `grown` is added on each side, m."""
    whole = Manifold.batch_boolean(
        [
            placed_at(_primitive(shape, grown), shape.rotation, shape.offset)
            for shape in part.shapes
        ],
        OpType.Add,
    )
    return placed_at(whole, part.rotation, part.at).scale([scale] * 3)


def with_pegs(
    bodies: Mapping[int, Any], geometry: Geometry, scale: float, diameter: float
) -> dict[int, Any]:
    """Bodies with a peg where each is attached to its parent, and a hole there in the parent.

    What only lies on its parent, and two-ended blocks, get none.

    Raises:
        UsageError: A peg does not fit.
    """
    made, shift = dict(bodies), shift_of(geometry)
    for placed in geometry.blocks:
        parent = placed.step.parent
        if parent < 0 or placed.two_ended or library()[placed.type].joint.kind == "loose":
            continue
        at = np.multiply(swap(add(placed.origin, shift)), scale)
        inward = np.array(swap(placed.front))
        peg = _pin(at - diameter * inward, inward, diameter, 2 * diameter)
        hole_depth = diameter + DEEPER
        # it ends above the face: surfaces in one plane leave slivers
        length = hole_depth + DEEPER
        hole = _pin(at - hole_depth * inward, inward, diameter + 2 * CLEARANCE, length)
        wide = diameter + 2 * (CLEARANCE + WALL)
        for block, start, deep in (
            (parent, at - hole_depth * inward, hole_depth),
            (placed.id, at, diameter),
        ):
            around = _pin(start, inward, wide, deep) - _pin(start, inward, diameter, deep)
            if (made[block] ^ around).volume() < FILLED * around.volume():
                raise UsageError(
                    f"pegs of {diameter:g} mm are too thick where {placed.label} joins "
                    f"{geometry[parent].label}: take thinner pegs or make the machine larger"
                )
        made[parent] -= hole
        if library()[placed.type].shape == "caster":  # its fork leans a little into its parent
            made[placed.id] = made[placed.id].trim_by_plane(inward, float(at @ inward))
        made[placed.id] += peg
    return made


def _primitive(shape: Shape, grown: float) -> Any:
    x, y, z = (side + 2 * grown for side in shape.size)
    if shape.kind == "sphere":
        return Manifold.sphere(x / 2, SEGMENTS)
    if shape.kind == "cylinder":
        return Manifold.cylinder(z, x / 2, x / 2, SEGMENTS, center=True)
    return Manifold.cube((x, y, z), center=True)


def placed_at(solid: Any, rotation: Quat, at: Vec3 | Array) -> Any:
    """A body turned, then moved."""
    return solid.transform(np.column_stack((rotated_axes(rotation).T, at)))


def _pin(start: Array, way: Array, diameter: float, length: float) -> Any:
    """A cylinder that begins at a place and leads along one of the axes."""
    pin = Manifold.cylinder(length, diameter / 2, diameter / 2, SEGMENTS)
    return placed_at(pin, swap_quaternion(rotation_from_up(swap(way.tolist()))), start)
