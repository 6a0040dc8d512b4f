"""Owns roads: straight or turning, their walls, the sentences that tell them, and how far along
one a place is.

What lies on a road is obstacles.py's and rough.py's.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import atan2, cos, degrees, hypot, inf, pi, radians, sin, tan

from agentflow.env.scene import Thing, Vec3
from agentflow.env.tasks.base import Parameters
from agentflow.env.tasks.family import WOOD, wall
from agentflow.env.tasks.knobs import knob

FACET = radians(6)
"""Most that a curved wall turns from one flat piece to the next."""
LEAP = 20.0
"""m: no further along a road than this is a place looked for from one step to the next, so that
who leaves the road for another part of it gains nothing."""


class Road(Parameters):
    """The straight road between its walls."""

    half_width: float = knob(12, 9, 50, "m", "distance of the side walls' centres from x = 0")
    wall_height: float = knob(5, 0.5, 20, "m", "height of the walls")
    wall_thickness: float = knob(1, 0.2, 2, "m", "thickness of the walls")
    wall_friction: float = knob(0, 0, 2, "", "friction coefficient of the walls")
    back: float = knob(16, 10, 50, "m", "distance of the rear wall's centre behind z = 0")
    length: float = knob(250, 50, 1000, "m", "how far the side walls reach along z+")


class Curve(Parameters):
    """Where the road turns."""

    angle: float = knob(0, 0, 180, "degrees", "turn to the right; 0 leaves the road straight")
    at: float = knob(40, 10, 200, "m", "z at which it begins")
    inner_radius: float = knob(5, 1, 50, "m", "of the centre of the inner wall")
    back: float = knob(0, 0, 180, "degrees", "a second turn, to the left; 0 leaves it out")
    further: float = knob(60, 0, 200, "m", "straight road before the second turn")


@dataclass(frozen=True)
class Stretch:
    """A straight or evenly turning part of a centre line."""

    x: float
    z: float
    heading: float
    """From z+ towards x+, rad."""
    length: float
    turn: float = 0.0
    """What the heading gains along it, rad; positive to the right."""

    @property
    def radius(self) -> float:
        """m, with the sign of the turn; infinite where it is straight."""
        return self.length / self.turn if self.turn else inf

    @property
    def middle(self) -> tuple[float, float]:
        """x and z of the centre that it turns about."""
        right = self.radius * cos(self.heading), -self.radius * sin(self.heading)
        return self.x + right[0], self.z + right[1]

    @property
    def end(self) -> tuple[float, float, float]:
        """x, z and heading where it ends."""
        return self.place(self.length)

    def place(self, along: float, aside: float = 0.0) -> tuple[float, float, float]:
        """x, z and heading so far along it and so far to its right."""
        if not self.turn:
            ahead, right = (sin(self.heading), cos(self.heading)), self.heading + pi / 2
            x, z = self.x + along * ahead[0], self.z + along * ahead[1]
            return x + aside * sin(right), z + aside * cos(right), self.heading
        heading = self.heading + along / self.radius
        x, z = self.middle
        reach = self.radius - aside
        return x - reach * cos(heading), z + reach * sin(heading), heading

    def along(self, x: float, z: float) -> float:
        """How far along it the nearest place is, m; beyond its ends where it is straight."""
        if not self.turn:
            return (x - self.x) * sin(self.heading) + (z - self.z) * cos(self.heading)
        centre = self.middle
        sign = 1.0 if self.turn > 0 else -1.0
        pointing = atan2(sign * (z - centre[1]), -sign * (x - centre[0]))
        gained = sign * (pointing - self.heading)
        half = abs(self.turn) / 2
        gained = (gained - half + pi) % (2 * pi) - pi + half
        return abs(self.radius) * gained


@dataclass(frozen=True)
class Track:
    """A road's centre line; both ends go on straight for ever."""

    stretches: tuple[Stretch, ...]

    def place(self, along: float) -> tuple[float, float]:
        """x and z of the place so far along the line from its beginning, m."""
        for stretch in self.stretches[:-1]:
            if along <= stretch.length:
                return stretch.place(along)[:2]
            along -= stretch.length
        return self.stretches[-1].place(along)[:2]

    def along(self, x: float, z: float, near: float) -> float:
        """How far along the line from its beginning the nearest place to (x, z) is, m.

        Args:
            x: m.
            z: m.
            near: Where along the line to look, at most `LEAP` away.
        """
        if len(self.stretches) == 1:
            return self.stretches[0].along(x, z)
        best, found = inf, near
        begin = 0.0
        last = len(self.stretches) - 1
        for index, stretch in enumerate(self.stretches):
            low = near - LEAP if index == 0 else max(begin, near - LEAP)
            high = near + LEAP if index == last else min(begin + stretch.length, near + LEAP)
            if low <= high:
                there = min(max(begin + stretch.along(x, z), low), high)
                px, pz, _ = stretch.place(there - begin)
                if hypot(px - x, pz - z) < best:
                    best, found = hypot(px - x, pz - z), there
            begin += stretch.length
        return found


def track(road: Road, curve: Curve) -> Track:
    """The centre line, from z = 0 on."""
    radius = curve.inner_radius + road.half_width
    if not curve.angle:
        return Track((Stretch(0.0, 0.0, 0.0, road.length),))
    first = Stretch(0.0, 0.0, 0.0, curve.at)
    plan = [(radius * radians(curve.angle), radians(curve.angle))]
    if curve.back:
        plan += [(curve.further, 0.0), (radius * radians(curve.back), -radians(curve.back))]
    line = [first]
    for length, turn in plan:
        line.append(Stretch(*line[-1].end, length, turn))
    rest = max(road.back, road.length - sum(length for length, _ in plan) - curve.at)
    return Track((*line, Stretch(*line[-1].end, rest)))


def road_walls(road: Road, curve: Curve) -> tuple[Thing, ...]:
    """Walls on both sides and behind."""
    width = 2 * road.half_width - road.wall_thickness
    rear = wall(
        "wall back",
        0.0,
        -road.back,
        (width, road.wall_height, road.wall_thickness),
        road.wall_friction,
    )
    if curve.angle:
        first, *others = track(road, curve).stretches
        first = replace(first, z=-road.back, length=road.back + first.length)
        return (*_turning_walls(road, (first, *others)), rear)
    side: Vec3 = (road.wall_thickness, road.wall_height, road.length + road.back)
    middle = road.length / 2 - road.back / 2
    return (
        wall("wall left", -road.half_width, middle, side, road.wall_friction),
        wall("wall right", road.half_width, middle, side, road.wall_friction),
        rear,
    )


def _turning_walls(road: Road, line: Sequence[Stretch]) -> Iterator[Thing]:
    for side, sign in (("left", -1.0), ("right", 1.0)):
        count = 0
        for stretch in line:
            pieces = max(1, round(abs(stretch.turn) / FACET))
            for index in range(pieces):
                count += 1
                yield _piece(f"wall {side} {count}", road, stretch, pieces, index, sign)


def _piece(name: str, road: Road, stretch: Stretch, pieces: int, index: int, sign: float) -> Thing:
    """One flat piece of a wall; pieces of a curve touch it in their middles."""
    along = stretch.length * (index + 0.5) / pieces
    x, z, heading = stretch.place(along, sign * road.half_width)
    length = stretch.length
    if stretch.turn:
        reach = abs(stretch.radius - sign * road.half_width) + road.wall_thickness / 2
        length = 2 * reach * tan(abs(stretch.turn) / pieces / 2)
    return Thing(
        name,
        "box",
        (road.wall_thickness, road.wall_height, length),
        (x, road.wall_height / 2, z),
        (0.0, sin(heading / 2), 0.0, cos(heading / 2)),
        friction=road.wall_friction,
        color=WOOD,
    )


def road_sentences(road: Road, curve: Curve) -> tuple[str, ...]:
    """What designers are told."""
    straight = (
        f"A road runs along z+ between walls at x = -{road.half_width:g} m and x = "
        f"{road.half_width:g} m, {road.wall_height:g} m high, {road.length:g} m long, of "
        f"friction {road.wall_friction:g}; a wall closes it behind the machine at z = "
        f"-{road.back:g} m."
    )
    return (straight, *_curve_sentences(road, curve))


def way_of(curve: Curve) -> str:
    """Which way distances count."""
    return "along the road's centre line" if curve.angle else "along z+"


def _curve_sentences(road: Road, curve: Curve) -> Iterator[str]:
    if not curve.angle:
        return
    radius = curve.inner_radius + road.half_width
    line = track(road, curve).stretches
    x, z, _ = line[1].end
    yield (
        f"At z = {curve.at:g} m the road turns {curve.angle:g} degrees to the right (towards x+): "
        f"its centre line, between walls {2 * road.half_width:g} m apart all the way, follows a "
        f"circle of radius {radius:g} m about x = {radius:g} m, z = {curve.at:g} m, as far as x = "
        f"{_rounded(x)} m, z = {_rounded(z)} m."
    )
    x, z, heading = line[-1].end if not curve.back else line[-1].place(0.0)
    if curve.back:
        yield (
            f"After {curve.further:g} m straight on it turns {curve.back:g} degrees to the left, "
            f"on a circle of the same radius, as far as x = {_rounded(x)} m, "
            f"z = {_rounded(z)} m."
        )
    yield f"From there it goes on straight{_towards(heading)}."


def _rounded(value: float) -> str:
    return f"{round(value, 1) + 0.0:g}"


def _towards(heading: float) -> str:
    names = {0: " towards z+", 90: " towards x+", 180: " towards z-", -90: " towards x-"}
    return names.get(round(degrees(heading)), "")
