"""What engines have in common as they build bodies: solid shapes and axes of joints."""

from collections.abc import Sequence
from math import cos, pi, sin

from agentflow.env.physics.frames import swap, swap_turn
from agentflow.env.physics.model import Joint, Part, Shape
from agentflow.env.physics.structure.spanning_tree import Link, Piece
from agentflow.machine.geometry.vectors import Vec3, scale

CONE_SIDES = 24
YIELD = 0.1
"""Damping over stiffness of soft objects, s; chosen: what is put on them sinks in and stays."""
LONE_RADIUS = 0.1
"""Radius of the ball that replaces each part of a piece without any solid shape, m."""


def solid_shapes(piece: Piece, parts: Sequence[Part]) -> dict[int, tuple[Shape, ...]]:
    """The shapes of each part of a piece that collide."""
    found = {i: tuple(shape for shape in parts[i].shapes if shape.solid) for i in piece.parts}
    if any(found.values()):
        return found
    return dict.fromkeys(piece.parts, (Shape("sphere", (2 * LONE_RADIUS,) * 3),))


def cone_corners(size: Vec3) -> list[Vec3]:
    """Rim and tip of a cone along y about its centre, whose convex hull it is."""
    x, y, z = scale(size, 0.5)
    turns = [2 * pi * i / CONE_SIDES for i in range(CONE_SIDES)]
    return [*((x * cos(turn), -y, z * sin(turn)) for turn in turns), (0.0, y, 0.0)]


def joint_axis(joint: Joint, link: Link) -> Vec3:
    """Joint axis in the engine frame; reversed links turn the other way for the same position."""
    image = swap(joint.axis) if joint.kind == "prismatic" else swap_turn(joint.axis)
    return scale(image, -1.0) if link.reversed else image
