"""Mass, centre of mass and support polygon of a machine at rest on flat ground.

Exact, because masses are whole multiples of 0.05 kg and centres of 0.025 m.
"""

from collections.abc import Iterable

from agentflow.machine.blocks.library import library
from agentflow.machine.geometry.placement import Bank, Geometry
from agentflow.machine.geometry.pose import UNITS, Placed
from agentflow.machine.geometry.vectors import N

Point = tuple[int, int]
"""(x, z) in half units, 0.025 m."""

HALF_UNITS = 2 * UNITS

_ROLLING = frozenset({"Wheel", "Gear", "Payload"})
"""Categories whose round blocks stand on their rim or on one point, not on their box's corners."""


def mass(geometry: Geometry) -> float:
    """Mass of all blocks in kg."""
    return _weights(geometry)[1] / UNITS


def centre_of_mass(geometry: Geometry) -> tuple[float, float, float]:
    """Mass-weighted mean of the blocks' centres, machine frame, metres."""
    (x, y, z), scale = moments(geometry)
    return (x / scale, y / scale, z / scale)


def moments(geometry: Geometry) -> tuple[tuple[int, int, int], int]:
    """Centre of mass in exact fractions of a metre: (x, y, z) numerators and their denominator."""
    sums, total = _weights(geometry)
    return sums, HALF_UNITS * total


def support_polygon(geometry: Geometry) -> tuple[tuple[float, float], ...]:
    """Corners (x, z) in metres of the convex hull of all ground contacts.

    The ground is at the machine's lowest corner, unless the machine hangs on banks. Boxes touch it
    with their bottom corners, upright wheels and cogs with the line below their axis, flat ones
    with their rim, boulders at one point.
    Counterclockwise with x to the right and z up; one or two corners if the contacts are a point or
    a line.
    """
    return tuple((x / HALF_UNITS, z / HALF_UNITS) for x, z in _hull(geometry))


def stands(geometry: Geometry) -> bool:
    """Whether the centre of mass is over the support polygon, including its edges."""
    (x, _, z), total = _weights(geometry)
    hull = _hull(geometry)
    corners = [(total * u, total * v) for u, v in hull]
    inside_span = all(
        min(values) <= value <= max(values)
        for value, values in ((x, [u for u, _ in corners]), (z, [v for _, v in corners]))
    )
    edges = zip(corners, [*corners[1:], corners[0]], strict=True)
    sides = [_turn(start, end, (x, z)) for start, end in edges]
    return inside_span and all(side >= 0 for side in sides)


def on_ground(geometry: Geometry, placed: Placed) -> bool:
    """Whether a block rests on the ground or a bank as the machine is set down."""
    lowest = placed.shape is not None and placed.lo[1] == geometry.lo[1]
    if not geometry.banks:
        return lowest
    return bool(geometry.banks_under(placed.id)) or (lowest and not geometry.height)


def _weights(geometry: Geometry) -> tuple[tuple[int, int, int], int]:
    """Sums of mass times centre along x, y, z in half units, and the mass; in units of 0.05 kg."""
    x = y = z = total = 0
    for placed in geometry.blocks:
        weight = round(library()[placed.type].mass * UNITS)
        lo, hi = placed.lo, placed.hi
        x += weight * (lo[0] + hi[0])
        y += weight * (lo[1] + hi[1])
        z += weight * (lo[2] + hi[2])
        total += weight
    return (x, y, z), total


def _footprint(placed: Placed) -> list[Point]:
    """Points where a block on the ground touches it."""
    (x0, _, z0), (x1, _, z1) = placed.lo, placed.hi
    x, z = x0 + x1, z0 + z1
    block = library()[placed.type]
    shape = block.shape if block.category in _ROLLING else "box"
    if shape == "sphere":
        return [(x, z)]
    if shape == "cylinder":
        along_x, along_z = [(2 * x0, z), (2 * x1, z)], [(x, 2 * z0), (x, 2 * z1)]
        axis = placed.facing[0]
        return along_x if axis == "x" else along_z if axis == "z" else along_x + along_z
    return [(2 * u, 2 * v) for u in (x0, x1) for v in (z0, z1)]


def _supported(geometry: Geometry, placed: Placed) -> list[Point]:
    """The footprint of a block on the ground; on banks, the part that they support."""
    points = _footprint(placed)
    under = [_clip(geometry, points, bank) for bank in geometry.banks_under(placed.id)]
    return [point for part in under for point in part] if under else points


def _clip(geometry: Geometry, points: list[Point], bank: Bank) -> list[Point]:
    """Points of an upright rectangle or line, moved to the nearest of a bank; exact to 0.025 m."""
    (x0, z0), (x1, z1) = (
        [
            geometry.lo[axis] + geometry.hi[axis] + round(HALF_UNITS * edge)
            for axis, edge in zip((0, 2), corner, strict=True)
        ]
        for corner in (bank.low, bank.high)
    )
    return [(min(max(x, x0), x1), min(max(z, z0), z1)) for x, z in points]


def _hull(geometry: Geometry) -> list[Point]:
    """Corners of the convex hull of all footprints, counterclockwise."""
    touching = [placed for placed in geometry.blocks if on_ground(geometry, placed)]
    return convex_hull(point for placed in touching for point in _supported(geometry, placed))


def convex_hull(found: Iterable[tuple[N, N]]) -> list[tuple[N, N]]:
    """Corners of the convex hull of points, counterclockwise (monotone chain)."""
    points = sorted(set(found))
    if len(points) < 3:
        return points
    lower, upper = _chain(points), _chain(points[::-1])
    return lower[:-1] + upper[:-1]


def _chain(points: list[tuple[N, N]]) -> list[tuple[N, N]]:
    chain: list[tuple[N, N]] = []
    for point in points:
        while len(chain) > 1 and _turn(chain[-2], chain[-1], point) <= 0:
            chain.pop()
        chain.append(point)
    return chain


def _turn(a: tuple[N, N], b: tuple[N, N], c: tuple[N, N]) -> N:
    """Positive when a, b, c turn left, with x to the right and z up."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
