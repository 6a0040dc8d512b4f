"""Owns placement: cogs in a row from the given source, by chance, until every target is driven.

It knows which cogs mesh and how senses alternate, looks no further ahead than one cog, and gives
up after a few tries, so that some of its answers do what is asked and some do not.
"""

from __future__ import annotations

import random
import re
from collections.abc import Sequence
from math import hypot
from typing import NamedTuple

from agentflow.llm.procedural.reading import Facts
from agentflow.machine.blocks import library
from agentflow.machine.plates import Plate, plate_of
from agentflow.machine.tree import Machine, Step

TRIES, LONGEST = 8, 12  # begun ways; cogs that one has at most
_ASKED = re.compile(r"block (\d{1,3}) \(target\) turns in the (same|opposite) sense")


class Cog(NamedTuple):
    """A cog on the plate: type, middle (m), pitch radius (m), sense, 0 while nothing drives it."""

    type: int
    x: float
    z: float
    radius: float
    sense: int

    def clear(self, other: Cog) -> bool:
        """Whether two cogs do not overlap."""
        apart = max(abs(self.x - other.x), abs(self.z - other.z))
        return apart > self.radius + other.radius - 1e-6

    def meshes(self, other: Cog) -> bool:
        """Whether their pitch circles touch within 0.1 m."""
        apart = hypot(self.x - other.x, self.z - other.z)
        return abs(apart - self.radius - other.radius) < 0.1


def place_cogs(facts: Facts, given: Machine, chance: random.Random) -> str:
    """The given steps and a way of cogs, complete or the last one tried."""
    plate = plate_of(given[0].type)
    if plate is None:
        return "There is no plate."
    wanted = {int(i): 1 if word == "same" else -1 for i, word in _ASKED.findall(facts.task)}
    start = [_cog(step, plate, int(step.id == 1)) for step in given.steps[1:]]
    cogs_known = {kind for kind, block in library().items() if block.pitch_radius}
    kinds = sorted(facts.types & cogs_known - {start[0].type})
    done, cogs = False, start
    for _ in range(TRIES if kinds else 0):
        done, cogs = _way(start, wanted, plate, kinds, chance)
        if done:
            break
    added = [
        Step(len(given) + i, cog.type, 0, plate.face(cog.x, cog.z))
        for i, cog in enumerate(cogs[len(start) :])
    ]
    told = ", ".join(f"({cog.x:g}, {cog.z:g})" for cog in cogs[len(start) :])
    verdict = "Every target is driven as asked." if done else "I found no way to the end."
    tree = Machine((*given, *added)).to_text()
    return f"Cogs at {told or 'no place'}. {verdict}\n```json\n{tree}\n```"


def _cog(step: Step, plate: Plate, sense: int) -> Cog:
    radius = library()[step.type].pitch_radius or 0.0
    return Cog(step.type, *plate.place(step.face_id), radius, sense)


def _way(
    start: Sequence[Cog],
    wanted: dict[int, int],
    plate: Plate,
    kinds: Sequence[int],
    chance: random.Random,
) -> tuple[bool, list[Cog]]:
    """One try: cogs beside driven cogs, rather towards the nearest target than away from it."""
    cogs = list(start)
    for _ in range(10 * LONGEST):
        left = [i for i in wanted if not cogs[i - 1].sense]
        if not left or len(cogs) - len(start) >= LONGEST:
            return not left, cogs
        target = cogs[chance.choice(left) - 1]
        driven = [cog for i, cog in enumerate(cogs) if cog.sense and i + 1 not in wanted]
        best = min(driven, key=lambda cog: abs(cog.x - target.x) + abs(cog.z - target.z))
        beside = chance.choice((best, best, chance.choice(driven)))
        _try(cogs, _beside(beside, target, kinds, chance), wanted, plate)
    return False, cogs


def _beside(cog: Cog, target: Cog, kinds: Sequence[int], chance: random.Random) -> Cog:
    kind = chance.choice((kinds[0], *kinds))
    radius = library()[kind].pitch_radius or 0.0
    apart = cog.radius + radius
    x, z = 1 if target.x > cog.x else -1, 1 if target.z > cog.z else -1
    dx, dz = chance.choice(((x, 0), (0, z), (0, z), (-x, 0), (0, -z)))
    return Cog(kind, cog.x + dx * apart, cog.z + dz * apart, radius, -cog.sense)


def _try(cogs: list[Cog], new: Cog, wanted: dict[int, int], plate: Plate) -> None:
    """Add a cog where there is a face and room, no loop locks and targets turn as asked."""
    near = [i for i, cog in enumerate(cogs) if new.meshes(cog)]
    fits = plate.has(new.x, new.z) and all(new.clear(cog) for cog in cogs)
    turns = all(cogs[i].sense in (0, -new.sense) for i in near)
    right = all(wanted.get(i + 1, -new.sense) == -new.sense for i in near if not cogs[i].sense)
    if fits and turns and right:
        for i in near:
            cogs[i] = cogs[i]._replace(sense=-new.sense)
        cogs.append(new)
