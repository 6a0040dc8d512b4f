"""Answers of the inspector (geometry), the querier (queries on a rollout) and the analyst."""

from __future__ import annotations

import json
import random
import re
from collections.abc import Iterator

from agentflow.llm.procedural.mechanisms import (
    JOINTS,
    LOADS,
    MOVERS,
    RIGID,
    WHEELS,
    load_data,
    rigid_groups,
)
from agentflow.llm.procedural.reading import PromptContent
from agentflow.machine import Geometry, place
from agentflow.machine.geometry.balance import centre_of_mass, stands, support_polygon

_QUOTED = re.compile(r"^> (.+)$", re.MULTILINE)
_NUMBER = r"(-?\d{1,6}\.?\d{0,6})"
_BROKEN = re.compile(rf"block (\d{{1,6}}) \([^()\n]*\) off block (\d{{1,6}}) at {_NUMBER} s")


def inspect(prompt: PromptContent, rng: random.Random) -> str:  # noqa: ARG001
    """Write a critique from geometry alone, without random choices."""
    geometry = place(prompt.machine)
    x, y, z = centre_of_mass(geometry)
    boxes = [block for block in geometry.blocks if not block.two_ended]
    reach = {word: max(boxes, key=lambda b: max(s * b.lo[axis], s * b.hi[axis]))
             for word, (axis, s) in load_data("replies.yaml")["extremes"].items()}  # fmt: skip
    defects = [f"- likely | blocks {', '.join(map(str, blocks))} | structure none | {text}"
               for blocks, text in _find_defects(geometry)]  # fmt: skip
    names = [f"block {b.id} ({b.name}) facing {b.facing}" for b in geometry.blocks]
    idle = [f"block {b} on block {geometry[b].step.parent}" for b in _idle_blocks(geometry)]
    return str(load_data("replies.yaml")["inspection"]).format(
        world="\n".join(f"{word}: {block.id}" for word, block in reach.items()),
        moving="; ".join(names[b.id] for b in geometry.blocks if b.type in MOVERS) or "None.",
        special="; ".join(names[b.id] for b in geometry.blocks if b.type in LOADS) or "None.",
        mass=f"({x:.1f}, {y:.1f}, {z:.1f})",
        stands="stands" if stands(geometry) else "falls over before t = 0",
        idle="; ".join(idle) or "None.",
        defects="\n".join(defects) or "none",
    )


def _find_defects(geometry: Geometry) -> Iterator[tuple[list[int], str]]:
    """Failed checks: block ids and the consequence."""
    blocks, depth = geometry.blocks, [z for _, z in support_polygon(geometry)]
    ground = [b.id for b in blocks if not b.two_ended and b.lo[1] == geometry.lo[1]]
    arms = [b.id for b in blocks if b.type in JOINTS]
    wheels = [b.id for b in blocks if b.type in WHEELS]
    if not stands(geometry):
        yield ground, "the centre of mass is not above the footprint: it tips"
    elif arms and max(depth) - min(depth) < geometry.size[1]:
        yield ground, "footprint shorter than the height: the swinging arm tips it"
    for wheel in (b for b in blocks if b.type in WHEELS and b.facing[0] != "x"):
        yield [wheel.id], f"facing {wheel.facing} it does not drive to z+"
    if 0 < len(wheels) < 6:
        yield wheels, "too few wheels for a quick start"
    for arm in (arm for arm in arms if len(geometry.children(arm)) == 1):
        yield [arm], "unbalanced: loaded on one side only"
    for block in _idle_blocks(geometry):
        yield [block], "useless: it carries nothing and does not touch the ground"


def _idle_blocks(geometry: Geometry) -> list[int]:
    """Ids of static rigid blocks above the ground that carry nothing."""
    carried = {parent for block in geometry.blocks for parent in block.step.parents}
    group, high = rigid_groups(geometry), geometry.box_min[1] + 1.1
    still = [b for b in geometry.blocks if b.type in RIGID and group[b.id] == 0]
    return [b.id for b in still if b.id not in carried and b.box_min[1] > high]


def query(prompt: PromptContent, rng: random.Random) -> str:
    """Query the first broken connection around its time, else a moving block and the root."""
    moving = [step.id for step in prompt.machine if step.type in MOVERS]
    intervals = [(rng.choice(moving or [0]), 0.0, 1.0), (0, 0.0, 1.0)]
    broken = _BROKEN.search(prompt.sections["Simulation feedback"])
    if broken:
        start, end = max(0.0, float(broken[3]) - 0.4), float(broken[3]) + 0.4
        intervals = [(int(block), round(start, 2), round(end, 2)) for block in broken.groups()[:2]]
    queries = [{"id": b, "duration": [start, end], "properties": ["position", "velocity"]}
               for b, start, end in intervals if b < len(prompt.machine)]  # fmt: skip
    thought = "The broken connection is the weak point." if broken else "No breakage is reported."
    template = str(load_data("replies.yaml")["inquiry"])
    return template.format(thought=thought, queries=json.dumps(queries))


def analyse(prompt: PromptContent, rng: random.Random) -> str:  # noqa: ARG001
    """Repeat what edits did, which is all that it knows."""
    lines = _QUOTED.findall(prompt.sections["What edits did"])
    return "<Lessons>\n" + "\n".join(lines) + "\n</Lessons>"
