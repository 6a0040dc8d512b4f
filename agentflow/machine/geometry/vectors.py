"""Vectors and quaternions (x, y, z, w) as tuples.

Plain additions and multiplications in a fixed order, to give the same bits on every machine.
"""

from math import cos, sin, sqrt
from typing import TypeVar

Vec3 = tuple[float, float, float]
Quat = tuple[float, float, float, float]
"""(x, y, z, w); the formulas hold in right- and left-handed frames alike."""

IDENTITY: Quat = (0.0, 0.0, 0.0, 1.0)
N = TypeVar("N", int, float)


def add(a: tuple[N, N, N], b: tuple[N, N, N]) -> tuple[N, N, N]:
    """a + b."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def subtract(a: Vec3, b: Vec3) -> Vec3:
    """a - b."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def scale(a: Vec3, factor: float) -> Vec3:
    """a * factor."""
    return (a[0] * factor, a[1] * factor, a[2] * factor)


def dot(a: Vec3, b: Vec3) -> float:
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vec3, b: Vec3) -> Vec3:
    """Right-handed vector product."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def length(a: Vec3) -> float:
    """Euclidean length."""
    return sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


def rotation_from_up(direction: Vec3) -> Quat:
    """The shortest rotation that turns y+ to a direction of any length but 0."""
    size = length(direction)
    x, y, z = direction[0] / size, direction[1] / size, direction[2] / size
    # close to straight down, 1 + y loses precision
    square = (x * x + z * z) / (2.0 - 2.0 * y) if y < -0.999999 else (1.0 + y) / 2.0
    if square < 1e-24:
        return (1.0, 0.0, 0.0, 0.0)
    w = sqrt(square)
    return (z / (2.0 * w), 0.0, -x / (2.0 * w), w)


def about_axis(axis: Vec3, angle: float) -> Quat:
    """The rotation about a unit vector by an angle, rad."""
    x, y, z = scale(axis, sin(angle / 2))
    return (x, y, z, cos(angle / 2))


def product(first: Quat, second: Quat) -> Quat:
    """Hamilton product: `second`'s rotation, then `first`'s."""
    ax, ay, az, aw = first
    bx, by, bz, bw = second
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def inverse(rotation: Quat) -> Quat:
    """The opposite rotation, of a unit quaternion."""
    x, y, z, w = rotation
    return (-x, -y, -z, w)


def rotate_vector(rotation: Quat, vector: Vec3) -> Vec3:
    """A vector turned by a unit quaternion."""
    x, y, z, w = rotation
    a, b, c = vector
    u, v, t = 2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)
    return (a + w * u + y * t - z * v, b + w * v + z * u - x * t, c + w * t + x * v - y * u)
