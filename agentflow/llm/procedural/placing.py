"""Answers of the placer: random chains of cogs from the source to every target.

It plans only one cog ahead and gives up after a few attempts, so only some answers succeed.
"""

import random
import re
from collections.abc import Mapping, Sequence

from agentflow.errors import ConfigError
from agentflow.llm.procedural.reading import PromptContent
from agentflow.machine import Geometry, Machine, Step, library, place
from agentflow.machine.blocks.types import plate_of
from agentflow.machine.geometry.gears import gear_trains, meshing_pairs

ATTEMPTS, MAX_COGS = 8, 12  # per reply; per attempt
_TARGET = re.compile(r"block (\d{1,3}) \(target\) turns in the (same|opposite) direction")


def place_cogs(prompt: PromptContent, rng: random.Random) -> str:
    """Answer with the given steps and a chain of cogs, or the last attempt."""
    given = prompt.machine
    if plate_of(given[0].type) is None or len(given) == 1:
        return "There is no plate with a source."
    found = _TARGET.findall(prompt.sections["Task"])
    targets = {int(block): 1 if sense == "same" else -1 for block, sense in found}
    wanted = {i: sense for i, sense in targets.items() if 1 < i < len(given)}
    cogs = prompt.types - {given[1].type}
    kinds = sorted(kind for kind in cogs if library()[kind].pitch_radius)
    done, machine, most = False, given, min(MAX_COGS, prompt.brief.limits.blocks or MAX_COGS)
    for _ in range(ATTEMPTS if kinds else 0):
        done, machine = _try_chain(given, wanted, kinds, most, rng)
        if done:
            break
    centres = [cog.center for cog in place(machine).blocks[len(given) :]]
    positions = ", ".join(f"({x:g}, {z:g})" for x, _, z in centres)
    verdict = "Every target turns as required." if done else "I found no complete chain."
    return f"Cogs at {positions or 'no position'}. {verdict}\n```json\n{machine.to_text()}\n```"


def _try_chain(
    given: Machine, wanted: Mapping[int, int], kinds: Sequence[int], most: int, rng: random.Random
) -> tuple[bool, Machine]:
    """Add at most `most` cogs beside driven cogs, preferably towards a target.

    Returns:
        Whether all targets turn, and the machine.
    """
    machine = given
    for _ in range(10 * MAX_COGS):
        geometry = place(machine)
        speeds = _cog_speeds(geometry)
        left = [i for i in wanted if i not in speeds]
        if not left or len(machine) - len(given) >= most:
            return not left, machine
        to_x, _, to_z = geometry[rng.choice(left)].center
        driven = [geometry[i] for i in speeds if i not in wanted]
        best = min(driven, key=lambda c: abs(c.center[0] - to_x) + abs(c.center[2] - to_z))
        beside = rng.choice((best, best, rng.choice(driven)))
        kind, (x, _, z) = rng.choice((kinds[0], *kinds)), beside.center
        side, ahead = 1 if to_x > x else -1, 1 if to_z > z else -1
        dx, dz = rng.choice(((side, 0), (0, ahead), (0, ahead), (-side, 0), (0, -ahead)))
        apart = sum(library()[each].pitch_radius or 0.0 for each in (beside.type, kind))
        machine = _add_cog(machine, wanted, kind, x + dx * apart, z + dz * apart)
    return False, machine


def _add_cog(machine: Machine, wanted: Mapping[int, int], kind: int, x: float, z: float) -> Machine:
    """Add a cog unless it lacks a face or room, locks the gears or turns a target wrongly."""
    plate = plate_of(machine[0].type)
    assert plate is not None
    try:
        longer = Machine((*machine, Step(len(machine), kind, 0, plate.face(x, z))))
    except ConfigError:
        return machine
    geometry = place(longer)
    speeds = _cog_speeds(geometry)
    right = all(speeds[i] * sense > 0 for i, sense in wanted.items() if i in speeds)
    return longer if right and speeds[1] and not geometry.overlaps else machine


def _cog_speeds(geometry: Geometry) -> Mapping[int, float]:
    """Cog driven by block 1 -> its turns per turn of block 1; 0 if locked."""
    cogs = [block.id for block in geometry.blocks[1:]]
    return gear_trains(cogs, meshing_pairs(geometry.blocks, 0.1))[0].speeds
