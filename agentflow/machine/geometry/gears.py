"""Owns gear trains: which cogs mesh, how fast each turns, which hold each other fast.

Exact for ideal teeth; forces are the physics'.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import hypot
from typing import NamedTuple

from agentflow.machine.blocks.library import library
from agentflow.machine.geometry.pose import Placed

TOLERANCE = 1e-9
"""Relative difference of speeds that counts as none."""


class Meshing(NamedTuple):
    """Two cogs whose teeth are in each other: speed of `a` about its Front = -ratio x that of `b`.

    Ids ascend.
    """

    a: int
    b: int
    ratio: float


@dataclass(frozen=True)
class GearTrain:
    """Cogs that turn together, and what each does."""

    speeds: Mapping[int, float]
    """Block id -> turns about its Front per turn of the train's lowest id; 0 if locked."""
    locked: bool
    """Whether a closed loop wants a cog to turn both ways, so that none can turn."""


def meshing_pairs(blocks: Sequence[Placed], tolerance: float) -> tuple[Meshing, ...]:
    """Pairs of cogs in one plane whose pitch circles touch within `tolerance`, m.

    Speeds are equal and opposite where the circles touch, so turns go as the radii; cogs that
    face each other's way count their turns in opposite senses.
    """
    cogs = [
        (block, radius)
        for block in blocks
        if (radius := library()[block.type].pitch_radius) is not None
    ]
    found = []
    for i, (one, radius) in enumerate(cogs):
        for other, other_radius in cogs[i + 1 :]:
            sense = _dot(one.front, other.front)
            line = tuple(b - a for a, b in zip(one.center, other.center, strict=True))
            aside = _dot(line, one.front)
            apart = hypot(*(v - aside * f for v, f in zip(line, one.front, strict=True)))
            in_plane = abs(sense) > 0.5 and abs(aside) <= tolerance
            if in_plane and abs(apart - radius - other_radius) <= tolerance + 1e-9:
                found.append(Meshing(one.id, other.id, sense * other_radius / radius))
    return tuple(found)


def _dot(a: Sequence[float], b: Sequence[float]) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def gear_trains(cogs: Sequence[int], pairs: Sequence[Meshing]) -> tuple[GearTrain, ...]:
    """The trains that these cogs (block ids, ascending) make, by their lowest id."""
    left, found = list(cogs), []
    while left:
        speeds, locked, due = {left[0]: 1.0}, False, [left[0]]
        while due:
            here = due.pop()
            for cog, speed in _driven(here, speeds[here], pairs):
                if cog not in speeds:
                    speeds[cog] = speed
                    due.append(cog)
                elif abs(speeds[cog] - speed) > TOLERANCE * abs(speed):
                    locked = True
        left = [cog for cog in left if cog not in speeds]
        turning = dict(sorted(speeds.items()))
        found.append(GearTrain(dict.fromkeys(turning, 0.0) if locked else turning, locked))
    return tuple(found)


def _driven(cog: int, speed: float, pairs: Sequence[Meshing]) -> list[tuple[int, float]]:
    """The cogs that mesh with one of this speed, with theirs."""
    return [
        (pair.b, -speed / pair.ratio) if pair.a == cog else (pair.a, -pair.ratio * speed)
        for pair in pairs
        if cog in (pair.a, pair.b)
    ]
