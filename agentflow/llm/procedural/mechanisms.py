"""Owns how each part of a mechanism grows; mechanisms.yaml holds its words, types and ranges.

No machine is stored: a part is a rule over drawn dimensions, and what does not fit is left out.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from itertools import product
from math import hypot
from pathlib import Path
from typing import Any

import yaml

from agentflow.llm.procedural.growth import Growth, free
from agentflow.machine.blocks import BOULDER, CONTAINER, library
from agentflow.machine.brief import Brief

Dims = Mapping[str, int]
BEAMS, WHEELS, SPARE = (1, 63), (2, 46), (41, 15)
HINGE, SPRING, CUBE, MOTOR, BALLAST, LOG = 5, 9, 15, 22, 35, 63
JOINTS, RIGID = (MOTOR, HINGE), (*BEAMS, CUBE)


@cache
def data(name: str) -> Any:
    """A data file beside this module; not to be changed by those who read it."""
    return yaml.safe_load(Path(__file__).with_name(name).read_text("utf-8"))


def suited(brief: Brief) -> list[Any]:
    """The mechanisms that serve a task and can be built from its blocks; at least one."""
    book, blocks = data("mechanisms.yaml"), {*brief.blocks}
    main = {name: {*part["slots"][0]} for name, part in book["parts"].items()}
    fits = {name: not types or bool(types & blocks) for name, types in main.items()}
    able = [m for m in book["mechanisms"] if all(fits[name] for name in m["parts"])]
    purposes = ("throw", "drive", "stand") if BOULDER in brief.required else ("drive", "stand")
    return next(filter(None, ([m for m in able if m["purpose"] == p] for p in purposes)))


def _base(g: Growth, dims: Dims) -> None:
    beam = g.choose(BEAMS, SPARE)
    sides = {"z+": "ahead", "z-": "behind", "x+": "aside", "x-": "aside"}
    ends = [g.chain(beam, 0, side, dims[name]) for side, name in sides.items()]
    for end in list(filter(None, ends))[: dims["ballast"]]:
        g.hang(g.choose((BALLAST,)), end, "y+")


def _motor_tower(g: Growth, dims: Dims) -> None:
    top = g.chain(g.choose(BEAMS, SPARE), 0, "y+", dims["storeys"])
    motor = g.hang(g.choose((MOTOR,)), top, "x+", dims["below the top"])
    g.chain(g.choose((CUBE,)), motor or 0, "x+", dims["spacer"] if motor else 0)


def _hinge_tower(g: Growth, dims: Dims) -> None:
    beam = g.choose(BEAMS, SPARE)
    top = g.chain(beam, 0, "y+", 1 if beam == LOG else dims["storeys"])  # room for the boulder
    g.hang(g.choose((HINGE,)), top, "y+")
    g.chain(beam, top, "z-", dims["shelf"])


def _pivot(g: Growth) -> int:
    """What the arm hangs on: the joint, or the spacer on its front."""
    joint = max((step.id for step in g.machine if step.type in JOINTS), default=0)
    spacers = [b for b in g.geometry.children(joint) if g.geometry[b].facing == "x+" and joint]
    return max(spacers, default=joint)


def _arm(g: Growth, dims: Dims) -> None:
    pivot = _pivot(g)
    g.chain(g.choose(BEAMS, SPARE), pivot, "z+", int(g.machine[pivot].type == HINGE))
    arm = g.chain(g.choose(BEAMS, SPARE), pivot, "z-", dims["segments"])
    mouth = "z-" if dims["container"] > 1 else "y+"
    box = g.hang(g.choose((CONTAINER,)), arm, mouth) if dims["container"] else None
    g.hang(g.choose((BOULDER,)), box or arm, mouth if box else "y+")


def _counterweight(g: Growth, dims: Dims) -> None:
    lever = g.chain(g.choose((CUBE, *BEAMS)), _pivot(g), "z+", 1)
    g.chain(g.choose((BALLAST,)), lever, "z+", dims["weights"])


def _springs(g: Growth, dims: Dims) -> None:
    """From the lever's front end to whatever stands low and not behind."""
    pivot, blocks = _pivot(g), g.geometry.blocks
    front = [b for b in g.geometry.children(pivot) if blocks[b].facing == "z+"]
    tops = [(b, f.face_id) for b in front for f in blocks[b].faces if f.facing != "y+"]
    low = blocks[pivot].center[1] - 1.5
    near = [block for block in blocks[:pivot] if block.center[2] > -1]
    feet = [(b.id, f.face_id) for b in near for f in b.faces if f.position[1] < low]
    for _ in range(dims["springs"] if tops and feet else 0):
        g.add(g.choose((SPRING,)), g.chance.choice(tops), g.chance.choice(feet))


def _chassis(g: Growth, dims: Dims) -> None:
    beam = g.choose((*BEAMS, *SPARE))
    ends = [g.chain(beam, 0, "z+", dims["ahead"]), g.chain(beam, 0, "z-", dims["behind"])]
    for end, side in product(ends, ("x+", "x-")):
        g.chain(beam, end, side, dims["cross beams"])
    for end in ends[: dims["ballast"]]:
        g.hang(g.choose((BALLAST,)), end, "y+")


def _wheels(g: Growth, dims: Dims) -> None:
    """In pairs, those farthest from the root first."""
    faces = [(b.id, f) for b in g.geometry.blocks for f in free(g.geometry, b.id, "x")]
    spots = {(f.position, f.facing): (b, f.face_id) for b, f in faces if abs(f.position[1]) < 0.6}
    wheel, axles = g.choose(WHEELS), 0
    for (x, y, z), facing in sorted(spots, key=lambda spot: -hypot(*spot[0])):
        twin = spots.get(((-x, y, z), "x-"))
        if facing == "x+" and twin and axles < dims["axles"]:
            right = g.add(wheel, spots[(x, y, z), facing])
            axles += right is not None and g.add(wheel, twin) is not None


def _anything(g: Growth, dims: Dims) -> None:
    kinds = [kind for kind in sorted(g.types) if kind and not library()[kind].linear]
    for _ in range(dims["blocks"]):
        spots = [(b.id, f.face_id) for b in g.geometry.blocks for f in free(g.geometry, b.id)]
        g.add(g.choose(kinds), g.chance.choice(spots or [(0, 0)]))


RULES = {rule.__name__[1:]: rule for rule in (_base, _motor_tower, _hinge_tower, _arm, _chassis,
         _counterweight, _springs, _wheels, _anything)}  # fmt: skip
"""How a part is added to what stands, by the name in mechanisms.yaml."""
