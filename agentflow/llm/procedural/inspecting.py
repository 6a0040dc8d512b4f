"""Owns looking: the inspector's checks of a machine, and the querier's questions on a rollout.

Changing the machine is refining.py's.
"""

from __future__ import annotations

import json
import random
from collections.abc import Iterator

from agentflow.llm.procedural.growth import clusters
from agentflow.llm.procedural.mechanisms import (
    BALLAST,
    BEAMS,
    CUBE,
    HINGE,
    MOTOR,
    SPRING,
    WHEELS,
    data,
)
from agentflow.llm.procedural.reading import Facts
from agentflow.machine.balance import centre_of_mass, stands, support_polygon
from agentflow.machine.blocks import BOULDER, CONTAINER
from agentflow.machine.geometry import Geometry, place

_EXTREMES = {"frontmost": (2, 1), "rearmost": (2, -1), "leftmost": (0, -1), "rightmost": (0, 1),
             "topmost": (1, 1), "lowest": (1, -1)}  # fmt: skip
"""Question -> axis and sign of the direction in which the block reaches farthest."""


def inspect(facts: Facts, chance: random.Random) -> str:  # noqa: ARG001
    """A critique by geometry alone; nothing in it is left to chance."""
    assert facts.machine is not None
    geometry = place(facts.machine)
    x, y, z = centre_of_mass(geometry)
    boxes = [block for block in geometry.blocks if not block.two_ended]
    world = [
        f"{word}: {max(boxes, key=lambda b: max(s * b.lo[axis], s * b.hi[axis])).id}"
        for word, (axis, s) in _EXTREMES.items()
    ]
    chains = [f"block {b} on {geometry[b].step.parent}" for b in idle_blocks(geometry)]
    defects = [
        f"- blocks {', '.join(map(str, blocks))} | structure none | {text}"
        for blocks, text in _defects(geometry)
    ]
    return str(data("inspecting.yaml")["inspection"]).format(
        world="\n".join(world),
        moving=_named(geometry, MOTOR, HINGE, SPRING, *WHEELS),
        special=_named(geometry, BALLAST, CONTAINER, BOULDER),
        x=x, y=y, z=z,
        stands="stands" if stands(geometry) else "falls over before t = 0",
        idle="; ".join(chains) or "None.",
        defects="\n".join(defects) or "none",
    )  # fmt: skip


def _named(geometry: Geometry, *kinds: int) -> str:
    told = [
        f"block {b.id} ({b.name}) facing {b.facing}" for b in geometry.blocks if b.type in kinds
    ]
    return "; ".join(told) or "None."


def _defects(geometry: Geometry) -> Iterator[tuple[list[int], str]]:
    """Every check that fails: the blocks, and what follows."""
    blocks, low = geometry.blocks, geometry.lo[1]
    ground = [b.id for b in blocks if not b.two_ended and b.lo[1] == low]
    depth = [z for _, z in support_polygon(geometry)]
    arms = [b.id for b in blocks if b.type in (MOTOR, HINGE)]
    wheels = [b.id for b in blocks if b.type in WHEELS]
    if not stands(geometry):
        yield ground, "the centre of mass is not above what stands on the ground: it tips"
    elif arms and max(depth) - min(depth) < geometry.size[1]:
        yield ground, "shorter on the ground than high: what swings tips it"
    for wheel in wheels:
        if geometry[wheel].facing[0] != "x":
            yield [wheel], f"facing {geometry[wheel].facing} it does not drive to z+"
    if wheels and len(wheels) < 6:
        yield wheels, "too few wheels for a quick start"
    for arm in arms:
        if len(geometry.children(arm)) == 1:
            yield [arm], "unbalanced: its load hangs on one side only"
    for block in idle_blocks(geometry):
        yield [block], "useless: it bears nothing and stands on nothing"


def idle_blocks(geometry: Geometry) -> list[int]:
    """Rigid blocks above the ground that stand still and carry nothing."""
    carried = {parent for block in geometry.blocks for parent in block.step.parents}
    group, high = clusters(geometry), geometry.box_min[1] + 1.1
    return [b.id for b in geometry.blocks if b.type in (*BEAMS, CUBE) and b.id not in carried
            and group[b.id] == 0 and b.box_min[1] > high]  # fmt: skip


def query(facts: Facts, chance: random.Random) -> str:
    """Ask for what broke, around the moment; else for one moving block and the root."""
    assert facts.machine is not None
    first = [step.id for step in facts.machine if step.type in (BOULDER, MOTOR, HINGE, *WHEELS)]
    asked = [(chance.choice(first or [0]), 0.0, 1.0), (0, 0.0, 1.0)]
    for block, partner, time in facts.broken[:1]:
        asked = [(b, max(0.0, time - 0.4), time + 0.4) for b in (block, partner)]
    queries = [
        {"id": b, "duration": [round(t0, 2), round(t1, 2)], "properties": ["position", "velocity"]}
        for b, t0, t1 in asked
        if b < len(facts.machine)
    ]
    thought = "What broke shows the weak place." if facts.broken else "Nothing is told to break."
    reply = str(data("inspecting.yaml")["inquiry"])
    return reply.format(thought=thought, queries=json.dumps(queries))
