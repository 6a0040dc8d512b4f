"""Owns looking: the inspector's checks of a machine, and the querier's questions on a rollout.

Changing the machine is refining.py's.
"""

from __future__ import annotations

import json
import random

from agentflow.llm.procedural.growth import clusters
from agentflow.llm.procedural.mechanisms import BALLAST, BEAMS, CUBE, HINGE, MOTOR, SPRING, WHEELS
from agentflow.llm.procedural.reading import Facts
from agentflow.machine.blocks import BOULDER, CONTAINER, library
from agentflow.machine.geometry import Geometry, place

_SECTIONS = (
    "Three-Dimensional Perception of the World",
    "Question Answer",
    "Summary of Design Defects",
)
_EXTREMES = (
    ("frontmost", 2, 1),
    ("rearmost", 2, -1),
    ("leftmost", 0, -1),
    ("rightmost", 0, 1),
    ("topmost", 1, 1),
    ("lowest", 1, -1),
)
_MOTION = {
    MOTOR: "turns about its Front",
    HINGE: "swings freely about its Right-Left axis",
    SPRING: "pulls its ends together",
}


def inspect(facts: Facts, chance: random.Random) -> str:  # noqa: ARG001
    """A critique by geometry alone; nothing in it is left to chance."""
    assert facts.machine is not None
    geometry = place(facts.machine)
    told = (_world(geometry), _answers(facts, geometry), _defects(facts, geometry))
    return "\n".join(
        f"<{name}>\n{text}\n</{name}>" for name, text in zip(_SECTIONS, told, strict=True)
    )


def _world(geometry: Geometry) -> str:
    boxes = [block for block in geometry.blocks if not block.two_ended]
    lines = ["x+: right", "y+: up", "z+: forward"]
    for word, axis, sign in _EXTREMES:
        reach = {b.id: sign * (b.box_max if sign > 0 else b.box_min)[axis] for b in boxes}
        lines.append(f"{word}: {max(reach, key=lambda block: reach[block])}")
    return "\n".join(lines)


def _answers(facts: Facts, geometry: Geometry) -> str:
    x, y, z = mass_centre(geometry)
    (x0, x1), (z0, z1) = support(geometry)
    moving = [f"block {b.id} {_motion(b.type)}, facing {b.facing}" for b in geometry.blocks
              if b.type in (*_MOTION, *WHEELS)]  # fmt: skip
    special = [f"block {b.id} ({b.name}) at height {b.center[1]:.1f}" for b in geometry.blocks
               if b.type in (BALLAST, CONTAINER, BOULDER)]  # fmt: skip
    stands = x0 <= x <= x1 and z0 <= z <= z1
    return "\n".join(
        [
            f"1. {'; '.join(moving) or 'None.'}",
            f"2. {'; '.join(special) or 'None.'}",
            f"3. It lies at ({x:.1f}, {y:.1f}, {z:.1f}); the lowest blocks span x {x0:.1f} to "
            f"{x1:.1f} and z {z0:.1f} to {z1:.1f}, so it {'stands' if stands else 'falls over'}.",
            "4. What the motors and springs turn, they turn the other way round the rest.",
            f"5. {_idle(facts, geometry)}",
        ]
    )


def _motion(kind: int) -> str:
    return _MOTION.get(kind, "drives by its facing")


def _idle(facts: Facts, geometry: Geometry) -> str:
    idle = useless(facts, geometry)
    return "; ".join(f"block {b} on block {geometry[b].step.parent}" for b in idle) or "None."


def _defects(facts: Facts, geometry: Geometry) -> str:
    """Every check that fails, one line each."""
    found: list[tuple[list[int], str]] = []
    x, _, z = mass_centre(geometry)
    (x0, x1), (z0, z1) = support(geometry)
    lowest = [b.id for b in geometry.blocks if b.box_min[1] < geometry.box_min[1] + 0.05]
    if not (x0 + 0.2 < x < x1 - 0.2 and z0 + 0.2 < z < z1 - 0.2):
        found.append((lowest, "the centre of mass lies at the rim of what stands: it tips"))
    height = geometry.size[1]
    arms = [b.id for b in geometry.blocks if b.type in (MOTOR, HINGE)]
    if arms and min(x1 - x0, z1 - z0) < height:
        found.append(
            (lowest, f"narrower than its height of {height:.1f} m: the arm's swing tips it")
        )
    found += [
        ([b.id], "a powered wheel of this facing does not drive to z+: turn it to x+ or x-")
        for b in geometry.blocks
        if b.type in WHEELS and b.facing[0] != "x"
    ]
    wheels = [b.id for b in geometry.blocks if b.type in WHEELS]
    if wheels and len(wheels) < 6:
        found.append((wheels, "too few wheels for a quick start"))
    found += [([arm], "unbalanced: its load lies on one side only") for arm in arms
              if len(geometry.children(arm)) < 2]  # fmt: skip
    found += [
        ([block], "useless: it bears and moves nothing") for block in useless(facts, geometry)
    ]
    lines = [
        f"- blocks {', '.join(map(str, blocks))} | structure none | {text}"
        for blocks, text in found
    ]
    return "\n".join(lines) or "none"


def useless(facts: Facts, geometry: Geometry) -> list[int]:
    """Rigid blocks above the ground that carry nothing, balance nothing and stand still."""
    assert facts.machine is not None
    carried = {parent for step in facts.machine for parent in step.parents}
    group = clusters(geometry)
    return [
        b.id
        for b in geometry.blocks
        if b.id and b.id not in carried and group[b.id] == 0
        and b.type in (*BEAMS, CUBE) and b.box_min[1] > geometry.box_min[1] + 1.1
    ]  # fmt: skip


def mass_centre(geometry: Geometry) -> tuple[float, float, float]:
    """Centre of mass in the machine frame, every block taken at the centre of its box, m."""
    total = sum(library()[b.type].mass for b in geometry.blocks)
    x, y, z = (
        sum(library()[b.type].mass * b.center[axis] for b in geometry.blocks) / total
        for axis in range(3)
    )
    return x, y, z


def support(geometry: Geometry) -> tuple[tuple[float, float], tuple[float, float]]:
    """Least and greatest x, and z, of the blocks that reach down to the ground, m."""
    low = [b for b in geometry.blocks if b.box_min[1] < geometry.box_min[1] + 0.05]
    return (
        (min(b.box_min[0] for b in low), max(b.box_max[0] for b in low)),
        (min(b.box_min[2] for b in low), max(b.box_max[2] for b in low)),
    )


def query(facts: Facts, chance: random.Random) -> str:
    """Ask for what broke, around the moment; else for the payload, its holder and the root."""
    assert facts.machine is not None
    wanted = []
    for block, partner, time in facts.broken[:2]:
        span = [max(0.0, round(time - 0.4, 2)), round(time + 0.4, 2)]
        wanted += [_query(block, span, "velocity"), _query(partner, span, "rotation")]
    if not wanted:
        kinds = (BOULDER, CONTAINER, MOTOR, HINGE, *WHEELS)
        told = [step.id for step in facts.machine if step.type in kinds] or [0]
        wanted = [_query(block, [0.0, 1.0], "velocity") for block in chance.sample(told, 1)]
        wanted.append(_query(0, [0.0, 1.0], "rotation"))
    count = len(facts.machine)
    wanted = [item for item in wanted if 0 <= int(str(item["id"])) < count]
    thought = "What broke shows where it is weak." if facts.broken else "Nothing broke."
    return (
        f"<Thought Process>\n{thought}\n</Thought Process>\n"
        f"<Required Feedback>\n{json.dumps(wanted)}\n</Required Feedback>"
    )


def _query(block: int, span: list[float], prop: str) -> dict[str, object]:
    return {"id": block, "duration": span, "properties": ["position", prop]}
