"""Owns placement: cogs in a row from the given source, by chance, until every target is driven.

It looks no further ahead than one cog and gives up after a few tries, so that some of its answers
do what is asked and some do not. Which cogs mesh and how they turn is machine.gears' to say.
"""

from __future__ import annotations

import random
import re
from collections.abc import Mapping, Sequence

from agentflow.llm.procedural.reading import Facts
from agentflow.machine import Geometry, Machine, Step, library, place
from agentflow.machine.blocks.plates import plate_of
from agentflow.machine.geometry.gears import gear_trains, meshing_pairs

TRIES, LONGEST = 8, 12  # begun ways; cogs that one has at most
_ASKED = re.compile(r"block (\d{1,3}) \(target\) turns in the (same|opposite) sense")


def place_cogs(facts: Facts, chance: random.Random) -> str:
    """The given steps and a way of cogs, complete or the last one tried."""
    given = facts.machine
    if plate_of(given[0].type) is None or len(given) == 1:
        return "There is no plate with a source."
    told = facts.parts["Task"]
    asked = {int(i): 1 if word == "same" else -1 for i, word in _ASKED.findall(told)}
    wanted = {i: sense for i, sense in asked.items() if 1 < i < len(given)}
    cogs = facts.types - {given[1].type}
    kinds = sorted(kind for kind in cogs if library()[kind].pitch_radius)
    done, machine = False, given
    for _ in range(TRIES if kinds else 0):
        done, machine = _way(given, wanted, kinds, chance)
        if done:
            break
    centres = [cog.center for cog in place(machine).blocks[len(given) :]]
    places = ", ".join(f"({x:g}, {z:g})" for x, _, z in centres)
    verdict = "Every target is driven as asked." if done else "I found no way to the end."
    return f"Cogs at {places or 'no place'}. {verdict}\n```json\n{machine.to_text()}\n```"


def _way(
    given: Machine, wanted: Mapping[int, int], kinds: Sequence[int], chance: random.Random
) -> tuple[bool, Machine]:
    """One try: cogs beside driven cogs, rather towards the nearest target than away from it."""
    machine = given
    for _ in range(10 * LONGEST):
        geometry = place(machine)
        speeds = _speeds(geometry)
        left = [i for i in wanted if i not in speeds]
        if not left or len(machine) - len(given) >= LONGEST:
            return not left, machine
        to_x, _, to_z = geometry[chance.choice(left)].center
        driven = [geometry[i] for i in speeds if i not in wanted]
        best = min(driven, key=lambda c: abs(c.center[0] - to_x) + abs(c.center[2] - to_z))
        beside = chance.choice((best, best, chance.choice(driven)))
        kind, (x, _, z) = chance.choice((kinds[0], *kinds)), beside.center
        side, ahead = 1 if to_x > x else -1, 1 if to_z > z else -1
        dx, dz = chance.choice(((side, 0), (0, ahead), (0, ahead), (-side, 0), (0, -ahead)))
        apart = sum(library()[each].pitch_radius or 0.0 for each in (beside.type, kind))
        machine = _added(machine, wanted, kind, x + dx * apart, z + dz * apart)
    return False, machine


def _added(machine: Machine, wanted: Mapping[int, int], kind: int, x: float, z: float) -> Machine:
    """With one cog more if it has a face and room, locks no loop and turns targets as asked."""
    plate = plate_of(machine[0].type)
    if plate is None or not plate.has(x, z):
        return machine
    longer = Machine((*machine, Step(len(machine), kind, 0, plate.face(x, z))))
    geometry = place(longer)
    speeds = _speeds(geometry)
    right = all(speeds[i] * sense > 0 for i, sense in wanted.items() if i in speeds)
    return longer if right and speeds[1] and not geometry.overlaps else machine


def _speeds(geometry: Geometry) -> Mapping[int, float]:
    """Cog that the source, block 1, drives -> its turns per turn of the source; 0 if locked."""
    cogs = [block.id for block in geometry.blocks[1:]]
    return gear_trains(cogs, meshing_pairs(geometry.blocks, 0.1))[0].speeds
