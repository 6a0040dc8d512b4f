"""Springs and winches, and the forces with which they pull two parts together.

On plain floats, written out: machines have few of them, arrays only pay for many, and calls would
take longer than what they compute.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import sqrt

from agentflow.env.physics.laws.forces import Entry, PartForce, PartLocations, part_motion
from agentflow.env.physics.rows import Row
from agentflow.machine.geometry.vectors import Vec3, scale

RowPoint = tuple[int, Vec3]
"""Row of a cluster and offset from its leading part's centre, as `PartLocations.locate` gives."""


@dataclass(frozen=True)
class Spring:
    """Pulls two parts together along the line between their centres, while it is on."""

    a: int
    """Part index."""
    b: int
    """Part index."""
    natural: float
    """Length at which the pull is gone, m."""
    ramp: float
    """Beyond the natural length the pull grows to `force` over this length, m."""
    force: float
    """N."""
    damping: float
    """N s/m."""
    starts: Entry = "springs"
    """The entry whose level it follows."""


@dataclass(frozen=True)
class Winch:
    """A rope between two parts' centres that is reeled in while it is on.

    It is strung, taut, when it is first switched on, and never pushes.
    """

    a: int
    """Part index."""
    b: int
    """Part index."""
    speed: float
    """m/s of rope taken in."""
    shortest: float
    """m; reeling in stops at this length."""
    stiffness: float
    """N/m."""
    damping: float
    """N s/m."""
    force: float
    """Greatest pull, N; a greater load draws rope out."""
    starts: Entry = "winches"
    """The entry whose level it follows."""


class SpringForce:
    """Pull of all springs of a machine."""

    def __init__(
        self, springs: Sequence[Spring], locations: PartLocations, levels: Mapping[Entry, float]
    ) -> None:
        """Locate the ends; `levels` of entries are read in every step."""
        self._levels = levels
        self._springs = [(s, locations.locate(s.a), locations.locate(s.b)) for s in springs]

    def __call__(self, rows: Sequence[Row]) -> list[PartForce]:
        """Forces in this step."""
        pulls = []
        for spring, one, other in self._springs:
            level = max(self._levels.get(spring.starts, 0.0), 0.0)  # springs cannot push
            if not level:
                continue
            at_a, at_b, along, distance, rate = _line(rows, one, other)
            stretch = min((distance - spring.natural) / spring.ramp, 1.0)
            if stretch > 0.0:
                strength = max(spring.force * stretch + spring.damping * rate, 0.0)
                force = scale(along, level * strength)
                pulls += opposite_forces(spring.a, at_a, spring.b, at_b, force)
        return pulls


class WinchForce:
    """Pull of all winches of a machine, and the length of each rope.

    Ropes outlive splits of the machine: set up once per world, then call `locate_parts`.
    """

    def __init__(
        self, winches: Sequence[Winch], levels: Mapping[Entry, float], step: float
    ) -> None:
        """Start with no rope strung; `levels` are read in every step, and -1 lets rope out."""
        self._winches, self._levels = winches, levels
        self.step = step
        """Time between calls, s."""
        self._left: list[float | None] = [None] * len(winches)
        """Length of each rope, m; None until it is strung."""
        self._ends: list[tuple[RowPoint, RowPoint]] = []

    def __bool__(self) -> bool:
        return bool(self._winches)

    def locate_parts(self, locations: PartLocations) -> None:
        """Locate the ends of the ropes, after each split of the machine."""
        self._ends = [(locations.locate(w.a), locations.locate(w.b)) for w in self._winches]

    def __call__(self, rows: Sequence[Row]) -> list[PartForce]:
        """Reel in or out, then the forces in this step."""
        pulls = []
        for i, (winch, ends) in enumerate(zip(self._winches, self._ends, strict=True)):
            level, left = self._levels.get(winch.starts, 0.0), self._left[i]
            if left is None and not level:
                continue
            at_a, at_b, along, distance, rate = _line(rows, *ends)
            left = distance if left is None else left
            left = max(left - level * winch.speed * self.step, min(left, winch.shortest))
            left = self._left[i] = max(left, distance - winch.force / winch.stiffness)
            if distance > left:
                pull = winch.stiffness * (distance - left) + winch.damping * rate
                force = scale(along, min(max(pull, 0.0), winch.force))
                pulls += opposite_forces(winch.a, at_a, winch.b, at_b, force)
        return pulls


def _line(
    rows: Sequence[Row], one: RowPoint, other: RowPoint
) -> tuple[Vec3, Vec3, Vec3, float, float]:
    """Two points, the unit vector from one to the other, their distance and its rate of change."""
    at_a, (ux, uy, uz) = part_motion(rows[one[0]], one[1])
    at_b, (vx, vy, vz) = part_motion(rows[other[0]], other[1])
    x, y, z = at_b[0] - at_a[0], at_b[1] - at_a[1], at_b[2] - at_a[2]
    distance = max(sqrt(x * x + y * y + z * z), 1e-9)
    per = 1.0 / distance
    x, y, z = x * per, y * per, z * per
    return at_a, at_b, (x, y, z), distance, (vx - ux) * x + (vy - uy) * y + (vz - uz) * z


def opposite_forces(a: int, at_a: Vec3, b: int, at_b: Vec3, force: Vec3) -> list[PartForce]:
    """`force` on part `a` and its reaction on part `b`."""
    return [(a, force, at_a), (b, scale(force, -1.0), at_b)]
