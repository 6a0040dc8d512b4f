"""What gravity and thrust do to a machine at rest, and what each turning joint carries.

Springs, motors and the ground exert no force here, except that what stands on the ground is held.
Machine frame, metres, kilograms, seconds. Masses and inertia are those of the simulated parts.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from math import dist
from typing import NamedTuple

from agentflow.machine.blocks.library import library
from agentflow.machine.geometry.balance import centre_of_mass, on_ground
from agentflow.machine.geometry.mobility import Sets
from agentflow.machine.geometry.pieces import Bond, extra_bonds, parent_bonds
from agentflow.machine.geometry.placement import Geometry
from agentflow.machine.geometry.pose import Placed
from agentflow.machine.geometry.vectors import Vec3, add, cross, dot, length, scale, subtract

GRAVITY = 32.81
"""m/s2 along y-; `gravity` in env/constants.json."""
END_RADIUS = 0.1
"""Radius of the balls that two-ended blocks have as ends, m, as simulated."""


class Mass(NamedTuple):
    """A block, or half of a two-ended block."""

    end: int
    """As numbered in `pieces.Bond`."""
    mass: float
    centre: Vec3
    inertia: Vec3
    """Principal moments, along the axes of the machine frame."""


@dataclass(frozen=True)
class Load:
    """What a connection carries: everything that would come off with its block."""

    bond: Bond
    blocks: frozenset[int]
    """Ids, the connection's own block included."""
    mass: float
    centre: Vec3
    """Centre of mass, from the pivot."""
    inertia: float
    """About the axis of the joint, kg m2."""
    reach: float
    """Greatest distance of a corner from the axis."""
    farthest: int
    """The block with that corner."""
    standing: bool
    """Whether any of it stands on the ground."""

    @property
    def gravity(self) -> Vec3:
        """Moment of gravity about the pivot, N m."""
        return cross(self.centre, (0.0, -GRAVITY * self.mass, 0.0))

    @property
    def turning(self) -> float:
        """Moment of gravity about the joint's axis, N m; positive along positive turns."""
        return dot(self.bond.axis, self.gravity)

    @property
    def most_turning(self) -> float:
        """Greatest moment of gravity about the joint's axis in any position of the joint, N m."""
        axis = self.bond.axis
        level = length(cross(axis, (0.0, 1.0, 0.0)))
        return GRAVITY * self.mass * length(cross(axis, self.centre)) * level


def tree_loads(geometry: Geometry) -> Iterator[Load]:
    """What each connection of a block to its parent carries; none for those within a loop."""
    loose = [
        Bond(placed.id, 2 * placed.step.parent, 2 * placed.id)
        for placed in geometry.blocks
        if library()[placed.type].joint.kind == "loose"
    ]
    own = list(parent_bonds(geometry))
    others = [*extra_bonds(geometry), *loose]
    masses = list(_masses(geometry))
    for bond in own:
        sides = Sets()
        for other in (*own, *others):
            if other is not bond:
                sides.join(other.a, other.b)
        if sides.find(bond.a) != sides.find(bond.b) and not geometry[bond.block].two_ended:
            side = sides.find(bond.b)
            yield _load(geometry, bond, [m for m in masses if sides.find(m.end) == side])


def thrust(geometry: Geometry) -> tuple[Vec3, Vec3]:
    """Sum of all thrusts, N, and their moment about the centre of mass, N m."""
    middle = centre_of_mass(geometry)
    force: Vec3 = (0.0, 0.0, 0.0)
    moment = force
    for placed in geometry.blocks:
        push = scale(placed.direction(library()[placed.type].push), _thrust_of(placed, geometry))
        force = add(force, push)
        moment = add(moment, cross(subtract(placed.center, middle), push))
    return force, moment


def _thrust_of(placed: Placed, geometry: Geometry) -> float:
    """Thrust of a block, N: more if a flame heats it and it knows steam."""
    kind = library()[placed.type]
    if kind.thrust is None or kind.steam is None:
        return kind.thrust or 0.0
    flames = ((block, flame) for block in geometry.blocks if (flame := library()[block.type].flame))
    heated = any(
        dist(placed.center, add(block.center, scale(block.direction(flame.direction), flame.reach)))
        <= flame.radius
        for block, flame in flames
    )
    return kind.thrust * (kind.steam if heated else 1.0)


def corners(placed: Placed) -> list[Vec3]:
    """The corners of a block's box; the ends of a two-ended block."""
    if placed.end_a is not None and placed.end_b is not None:
        return [placed.end_a, placed.end_b]
    axes = zip(placed.box_min, placed.box_max, strict=True)
    return [(x, y, z) for x, y, z in product(*axes)]


def _load(geometry: Geometry, bond: Bond, masses: list[Mass]) -> Load:
    pivot, axis = geometry[bond.block].origin, bond.axis
    total = sum(item.mass for item in masses)
    weighted = [scale(subtract(item.centre, pivot), item.mass / total) for item in masses]
    x, y, z = (sum(part) for part in zip(*weighted, strict=True))
    blocks = frozenset(item.end // 2 for item in masses)
    boxed = [geometry[block] for block in blocks if not geometry[block].two_ended]
    reach, farthest = max(
        (length(cross(axis, subtract(corner, pivot))), -block.id)
        for block in boxed
        for corner in corners(block)
    )
    return Load(
        bond=bond,
        blocks=blocks,
        mass=total,
        centre=(x, y, z),
        inertia=sum(_about(axis, subtract(item.centre, pivot), item) for item in masses),
        reach=reach,
        farthest=-farthest,
        standing=any(on_ground(geometry, block) for block in boxed),
    )


def _about(axis: Vec3, arm: Vec3, item: Mass) -> float:
    off = length(cross(axis, arm))
    squared = (axis[0] ** 2, axis[1] ** 2, axis[2] ** 2)
    return item.mass * off * off + dot(squared, item.inertia)


def _masses(geometry: Geometry) -> Iterator[Mass]:
    for placed in geometry.blocks:
        kind = library()[placed.type]
        if placed.end_a is not None and placed.end_b is not None:
            half = kind.mass / 2
            ball = 0.4 * half * END_RADIUS * END_RADIUS
            for end, at in enumerate((placed.end_a, placed.end_b)):
                yield Mass(2 * placed.id + end, half, at, (ball, ball, ball))
        else:
            yield Mass(2 * placed.id, kind.mass, placed.center, _inertia(placed))


def _inertia(placed: Placed) -> Vec3:
    """Principal moments of a homogeneous ball, cylinder about Front, or box."""
    kind, size = library()[placed.type], subtract(placed.box_max, placed.box_min)
    if kind.shape == "sphere":
        ball = 0.1 * kind.mass * size[0] * size[0]
        return (ball, ball, ball)
    if kind.shape == "cylinder" and kind.size is not None:
        radius, width = kind.size[0] / 2, kind.size[2]
        across = kind.mass * (3 * radius * radius + width * width) / 12
        along = kind.mass * radius * radius / 2
        x, y, z = (along if abs(part) > 0.5 else across for part in placed.front)
        return (x, y, z)
    x, y, z = (side * side * kind.mass / 12 for side in size)
    return (y + z, x + z, x + y)
