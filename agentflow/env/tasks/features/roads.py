"""Roads: walls, centre lines, distances along them, and their description."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import atan2, cos, degrees, hypot, inf, pi, radians, sin, tan

from agentflow.env.scene import SceneObject
from agentflow.env.tasks.base import Parameters
from agentflow.env.tasks.family import WOOD, wall
from agentflow.env.tasks.knobs import knob
from agentflow.machine.geometry.vectors import Vec3, about_axis

FACET = radians(6)
"""Largest angle between neighbouring flat pieces of a curved wall, rad."""
LEAP = 20.0
"""Search range along a road from one step to the next, m. Because of it, leaving the road and
rejoining it farther on gains nothing."""


class Road(Parameters):
    """A road between walls."""

    half_width: float = knob(12, 9, 50, "m", "distance of the side walls' centres from x = 0")
    wall_height: float = knob(5, 0.5, 20, "m", "height of the walls")
    wall_thickness: float = knob(1, 0.2, 2, "m", "thickness of the walls")
    wall_friction: float = knob(0, 0, 2, "", "friction coefficient of the walls")
    back: float = knob(16, 10, 50, "m", "distance of the rear wall's centre behind z = 0")
    length: float = knob(250, 50, 1000, "m", "length of the side walls along z+")

    @property
    def inner_width(self) -> float:
        """Distance between the side walls, m."""
        return 2 * self.half_width - self.wall_thickness


class Curve(Parameters):
    """Turns of the road."""

    angle: float = knob(0, 0, 180, "degrees", "first turn, to the right; 0 keeps the road straight")
    at: float = knob(40, 10, 200, "m", "z where the first turn starts")
    inner_radius: float = knob(5, 1, 50, "m", "radius of the inner wall's centre line")
    back: float = knob(0, 0, 180, "degrees", "second turn, to the left; 0 removes it")
    further: float = knob(60, 0, 200, "m", "length of straight road between the turns")


@dataclass(frozen=True)
class Segment:
    """A straight line or circular arc of a centre line.

    It begins with `heading`, from z+ towards x+, which changes by `turn`, positive to the right; m,
    rad.
    """

    x: float
    z: float
    heading: float
    length: float
    turn: float = 0.0

    @cached_property
    def _ahead(self) -> tuple[float, float]:
        """x and z of the unit vector along it where it begins; referees ask in every step."""
        return sin(self.heading), cos(self.heading)

    @property
    def radius(self) -> float:
        """Radius in m, with the sign of the turn; infinite if straight."""
        return self.length / self.turn if self.turn else inf

    @property
    def arc_centre(self) -> tuple[float, float]:
        """x and z of the arc's centre, m."""
        right = self.radius * cos(self.heading), -self.radius * sin(self.heading)
        return self.x + right[0], self.z + right[1]

    @property
    def end(self) -> tuple[float, float, float]:
        """x, z and heading at the end."""
        return self.position_at(self.length)

    def position_at(self, along: float, aside: float = 0.0) -> tuple[float, float, float]:
        """x, z and heading at a distance along the segment and to its right, m."""
        if not self.turn:
            ahead, right = self._ahead, self.heading + pi / 2
            x, z = self.x + along * ahead[0], self.z + along * ahead[1]
            return x + aside * sin(right), z + aside * cos(right), self.heading
        heading = self.heading + along / self.radius
        x, z = self.arc_centre
        reach = self.radius - aside
        return x - reach * cos(heading), z + reach * sin(heading), heading

    def distance_along(self, x: float, z: float) -> float:
        """Distance along the segment to the point nearest to (x, z), m; may lie beyond its ends."""
        if not self.turn:
            ahead = self._ahead
            return (x - self.x) * ahead[0] + (z - self.z) * ahead[1]
        centre = self.arc_centre
        sign = 1.0 if self.turn > 0 else -1.0
        pointing = atan2(sign * (z - centre[1]), -sign * (x - centre[0]))
        gained = sign * (pointing - self.heading)
        half = abs(self.turn) / 2
        gained = (gained - half + pi) % (2 * pi) - pi + half
        return abs(self.radius) * gained


@dataclass(frozen=True)
class CentreLine:
    """Centre line of a road; both ends continue straight without limit."""

    segments: tuple[Segment, ...]

    def position_at(self, along: float) -> tuple[float, float]:
        """x and z at a distance along the line, m."""
        for segment in self.segments[:-1]:
            if along <= segment.length:
                return segment.position_at(along)[:2]
            along -= segment.length
        return self.segments[-1].position_at(along)[:2]

    def distance_along(self, x: float, z: float, near: float) -> float:
        """Distance along the line to its point nearest to (x, z), m.

        Args:
            x: m.
            z: m.
            near: Distance along the line to search around, by at most `LEAP`, m.
        """
        if len(self.segments) == 1:
            return self.segments[0].distance_along(x, z)
        best, nearest = inf, near
        begin = 0.0
        last = len(self.segments) - 1
        for index, segment in enumerate(self.segments):
            low = near - LEAP if index == 0 else max(begin, near - LEAP)
            high = near + LEAP if index == last else min(begin + segment.length, near + LEAP)
            if low <= high:
                there = min(max(begin + segment.distance_along(x, z), low), high)
                px, pz, _ = segment.position_at(there - begin)
                if hypot(px - x, pz - z) < best:
                    best, nearest = hypot(px - x, pz - z), there
            begin += segment.length
        return nearest


def centre_line(road: Road, curve: Curve) -> CentreLine:
    """The centre line of a road, from z = 0 on."""
    radius = curve.inner_radius + road.half_width
    if not curve.angle:
        return CentreLine((Segment(0.0, 0.0, 0.0, road.length),))
    first = Segment(0.0, 0.0, 0.0, curve.at)
    plan = [(radius * radians(curve.angle), radians(curve.angle))]
    if curve.back:
        plan += [(curve.further, 0.0), (radius * radians(curve.back), -radians(curve.back))]
    line = [first]
    for length, turn in plan:
        line.append(Segment(*line[-1].end, length, turn))
    rest = max(road.back, road.length - sum(length for length, _ in plan) - curve.at)
    return CentreLine((*line, Segment(*line[-1].end, rest)))


def road_walls(road: Road, curve: Curve) -> tuple[SceneObject, ...]:
    """Walls on both sides and behind the machine."""
    end: Vec3 = (road.inner_width, road.wall_height, road.wall_thickness)
    rear = wall("wall back", 0.0, -road.back, end, road.wall_friction)
    if curve.angle:
        first, *others = centre_line(road, curve).segments
        first = replace(first, z=-road.back, length=road.back + first.length)
        return (*_turning_walls(road, (first, *others)), rear)
    side: Vec3 = (road.wall_thickness, road.wall_height, road.length + road.back)
    middle = road.length / 2 - road.back / 2
    return (
        wall("wall left", -road.half_width, middle, side, road.wall_friction),
        wall("wall right", road.half_width, middle, side, road.wall_friction),
        rear,
    )


def _turning_walls(road: Road, line: Sequence[Segment]) -> Iterator[SceneObject]:
    for side, sign in (("left", -1.0), ("right", 1.0)):
        count = 0
        for segment in line:
            pieces = max(1, round(abs(segment.turn) / FACET))
            for index in range(pieces):
                count += 1
                yield _wall_piece(f"wall {side} {count}", road, segment, pieces, index, sign)


def _wall_piece(
    name: str, road: Road, segment: Segment, pieces: int, index: int, sign: float
) -> SceneObject:
    """One flat piece of a wall; the middles of a curved wall's pieces lie on the curve."""
    along = segment.length * (index + 0.5) / pieces
    x, z, heading = segment.position_at(along, sign * road.half_width)
    length = segment.length
    if segment.turn:
        reach = abs(segment.radius - sign * road.half_width) + road.wall_thickness / 2
        length = 2 * reach * tan(abs(segment.turn) / pieces / 2)
    return SceneObject(
        name,
        "box",
        (road.wall_thickness, road.wall_height, length),
        (x, road.wall_height / 2, z),
        about_axis((0.0, 1.0, 0.0), heading),
        friction=road.wall_friction,
        color=WOOD,
    )


def told(road: Road, curve: Curve) -> dict[str, object]:
    """What templates of briefs name of a road, besides its knobs."""
    line = centre_line(road, curve).segments
    return {
        "way": scoring_direction(curve),
        "line": line,
        "heading": round(degrees(line[-1].heading)),
        "facet": degrees(FACET),
    }


def scoring_direction(curve: Curve) -> str:
    """The direction in which distances count, in words."""
    return "along the road's centre line" if curve.angle else "along z+"
