"""Gear trains: which cogs mesh, how fast each turns, and which trains are locked."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import hypot
from typing import NamedTuple

from agentflow.machine.blocks.library import library
from agentflow.machine.geometry.pose import Placed
from agentflow.machine.geometry.vectors import dot, subtract

TOLERANCE = 1e-9
"""Relative difference up to which speeds are equal."""


class Meshing(NamedTuple):
    """Two meshing cogs: speed of `a` about its Front = -ratio x speed of `b`; `a` < `b`."""

    a: int
    b: int
    ratio: float


@dataclass(frozen=True)
class GearTrain:
    """Cogs that turn together."""

    speeds: Mapping[int, float]
    """Block id -> turns about its Front per turn of the cog with the lowest id; 0 if locked."""
    locked: bool
    """Whether a closed loop would require two speeds of one cog, so none can turn."""


def meshing_pairs(blocks: Sequence[Placed], tolerance: float) -> tuple[Meshing, ...]:
    """Pairs of coplanar cogs whose pitch circles touch to within `tolerance` metres.

    Ratios are those of the radii, negative for cogs that face opposite ways.
    """
    cogs = [
        (block, radius)
        for block in blocks
        if (radius := library()[block.type].pitch_radius) is not None
    ]
    found = []
    for i, (one, radius) in enumerate(cogs):
        for other, other_radius in cogs[i + 1 :]:
            sense = dot(one.front, other.front)
            line = subtract(other.center, one.center)
            aside = dot(line, one.front)
            apart = hypot(*(v - aside * f for v, f in zip(line, one.front, strict=True)))
            in_plane = abs(sense) > 0.5 and abs(aside) <= tolerance
            if in_plane and abs(apart - radius - other_radius) <= tolerance + 1e-9:
                found.append(Meshing(one.id, other.id, sense * other_radius / radius))
    return tuple(found)


def gear_trains(cogs: Sequence[int], pairs: Sequence[Meshing]) -> tuple[GearTrain, ...]:
    """Group cogs (block ids, ascending) into trains, ordered by lowest id."""
    left, found = list(cogs), []
    while left:
        speeds, locked, queue = {left[0]: 1.0}, False, [left[0]]
        while queue:
            current = queue.pop()
            for cog, speed in _driven(current, speeds[current], pairs):
                if cog not in speeds:
                    speeds[cog] = speed
                    queue.append(cog)
                elif abs(speeds[cog] - speed) > TOLERANCE * abs(speed):
                    locked = True
        left = [cog for cog in left if cog not in speeds]
        turning = dict(sorted(speeds.items()))
        found.append(GearTrain(dict.fromkeys(turning, 0.0) if locked else turning, locked))
    return tuple(found)


def _driven(cog: int, speed: float, pairs: Sequence[Meshing]) -> list[tuple[int, float]]:
    """The cogs that mesh with a cog, and their speeds if it turns at `speed`."""
    return [
        (pair.b, -speed / pair.ratio) if pair.a == cog else (pair.a, -pair.ratio * speed)
        for pair in pairs
        if cog in (pair.a, pair.b)
    ]
