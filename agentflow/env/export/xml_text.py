"""Numbers, places and shapes as XML attributes of URDF."""

from __future__ import annotations

from collections.abc import Iterable
from math import asin, atan2, copysign, pi
from xml.etree.ElementTree import Element, SubElement

from agentflow.env.physics.frames import swap
from agentflow.env.physics.model import Shape
from agentflow.machine.geometry.vectors import IDENTITY, Quat, Vec3


def add_origin(element: Element, place: Vec3, rotation: Quat = IDENTITY) -> None:
    """Add a place and an orientation in the file's frame."""
    SubElement(element, "origin", xyz=numbers(place), rpy=numbers(roll_pitch_yaw(rotation)))


def roll_pitch_yaw(rotation: Quat) -> Vec3:
    """Angles of turns about x, then y, then z, all fixed axes, rad."""
    x, y, z, w = rotation
    sine = 2.0 * (w * y - z * x)
    if abs(sine) > 1.0 - 1e-12:  # roll and yaw turn about the same axis
        return 0.0, copysign(pi / 2, sine), -copysign(2.0, sine) * atan2(x, w)
    return (
        atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
        asin(sine),
        atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
    )


def size_of(shape: Shape) -> dict[str, str]:
    """Attributes of a shape; cylinders lie along z, the game's y."""
    radius = number(shape.size[0] / 2)
    if shape.kind == "sphere":
        return {"radius": radius}
    if shape.kind == "cylinder":
        return {"radius": radius, "length": number(shape.size[1])}
    return {"size": numbers(swap(shape.size))}


def numbers(values: Iterable[float]) -> str:
    """Such as "0 0.5 1"."""
    return " ".join(map(number, values))


def number(value: float) -> str:
    """To 12 digits, which is more than the library and the constants have."""
    return f"{value + 0.0:.12g}"  # + 0.0 turns -0 to 0
