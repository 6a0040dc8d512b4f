"""Build the parts of a mechanism by the rules, types and ranges in mechanisms.yaml.

Machines are not stored: dimensions are drawn at random, and blocks that do not fit are omitted.
"""

import random
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from importlib.resources import files
from itertools import pairwise, product
from math import dist, hypot
from pathlib import Path
from types import ModuleType
from typing import Any

import yaml

from agentflow.llm.procedural.reading import PromptContent
from agentflow.machine import Brief, Geometry, Step, library, place, spatial_problems
from agentflow.machine.blocks.library import BOULDER, CONTAINER, STARTING_BLOCK
from agentflow.machine.geometry.pose import PlacedFace
from agentflow.registry import Registry, package_with

Dims = Mapping[str, int]
BEAMS, WHEELS, SPARE = (1, 63), (2, 46), (41, 15)
HINGE, BRACE, SPRING, CUBE, MOTOR, BALLAST, WINCH = 5, 7, 9, 15, 22, 35, 45
SIDES = ("y-", "y+", "x-", "x+")
JOINTS, RIGID, LOADS = (MOTOR, HINGE), (*BEAMS, CUBE), (BALLAST, CONTAINER, BOULDER)
MOVERS = (*JOINTS, SPRING, *WHEELS)
STAND = "stand"
"""Purpose of a task that no words identify: a machine that stands."""
MECHANISMS_FILE = "mechanisms.yaml"
MECHANISMS: Registry[ModuleType] = Registry(
    "mechanisms of the task family", "agentflow.mechanisms", {}, package_with(MECHANISMS_FILE)
)
"""Family from another distribution -> package with its mechanisms, in a file like ours."""


@cache
def load_data(name: str) -> Any:
    """Load a YAML file of this package; do not modify the result."""
    return yaml.safe_load(Path(__file__).with_name(name).read_text("utf-8"))


def known_mechanisms(brief: Brief) -> Any:
    """The content of mechanisms.yaml, preceded by that of the task's family if it has its own."""
    return _mechanisms_of(brief.name.partition("/")[0])


@cache
def _mechanisms_of(family: str) -> Any:
    ours = load_data(MECHANISMS_FILE)
    if family not in MECHANISMS:
        return ours
    own = yaml.safe_load(files(MECHANISMS[family]).joinpath(MECHANISMS_FILE).read_text("utf-8"))
    return {
        "scenes": ours["scenes"],
        "purposes": {**own["purposes"], **ours["purposes"]},
        "parts": {**ours["parts"], **own.get("parts", {})},
        "mechanisms": [*own["mechanisms"], *ours["mechanisms"]],
    }


def purpose(brief: Brief) -> str:
    """Classify a task by words of its scene or objective; `STAND` if none match."""
    known, scene = known_mechanisms(brief), " ".join(brief.scene)
    told = ((known["scenes"], scene), (known["purposes"], brief.objective))
    found = (name for words, text in told for name in words if words[name] in text)
    return next(found, STAND)


def suitable_mechanisms(brief: Brief) -> list[Any]:
    """Mechanisms for a task that its blocks allow; at least one."""
    content, blocks = known_mechanisms(brief), {*brief.blocks}
    main = {name: {*part["slots"][0]} or blocks for name, part in content["parts"].items()}
    able = [m for m in content["mechanisms"] if all(main[name] & blocks for name in m["parts"])]
    wanted = (purpose(brief), "drive", STAND)
    return next(filter(None, ([m for m in able if m["purpose"] == p] for p in wanted)))


class Builder:
    """Adds blocks to a machine; blocks that would make it invalid are not added."""

    def __init__(self, prompt: PromptContent, rng: random.Random) -> None:
        """Start from the prompt's machine; only the prompt's types are added."""
        self.machine = prompt.machine
        self.geometry = place(self.machine)
        self.types, self.rng, self._brief = prompt.types, rng, prompt.brief

    def choose(self, *wanted: Sequence[int]) -> int | None:
        """A random allowed type from the first group that has one; None if none has."""
        usable = ([kind for kind in group if kind in self.types] for group in wanted)
        found = next(filter(None, usable), None)
        return self.rng.choice(found) if found else None

    def add(self, kind: int | None, *ends: tuple[int, int]) -> int | None:
        """Attach a block to (block, face), or between two of them; its id, None if invalid."""
        if kind is None or not self._has_room(kind) or len(ends) != 1 + library()[kind].linear:
            return None
        step = Step(len(self.machine), kind, *(part for end in ends for part in end))
        longer = replace(self.machine, steps=(*self.machine.steps, step))
        geometry = place(longer)
        if spatial_problems(geometry, self._brief.limits) or has_locked_joint(geometry):
            return None
        self.machine, self.geometry = longer, geometry
        return step.id

    def _has_room(self, kind: int) -> bool:
        """Whether the task allows one more block of a type, and then all those it requires."""
        most = self._brief.limits.blocks
        lacking = {k: n - self.machine.count(k) for k, n in self._brief.required.items()}
        left = sum(n for k, n in lacking.items() if k != kind)
        return lacking.get(kind, 1) > 0 and (most is None or len(self.machine) + left < most)

    def chain(self, kind: int | None, at: int, towards: str, count: int = 1, skip: int = 0) -> int:
        """Attach blocks in a row, each `skip` faces before its parent's far end; the last id."""
        for _ in range(count):
            back, faces = self.geometry[at].origin, open_faces(self.geometry, at, towards)
            faces.sort(key=lambda face: -dist(back, face.position))
            found = faces[min(skip, len(faces) - 1) :][:1]
            at = (self.add(kind, (at, found[0].face_id)) if found else None) or at
        return at


def open_faces(geometry: Geometry, block: int, towards: str = "") -> list[PlacedFace]:
    """Free faces of a block, all or those facing `towards`."""
    ids = geometry.free_faces(block)
    return [f for f in geometry[block].faces if f.face_id in ids and f.facing.startswith(towards)]


def rigid_groups(geometry: Geometry) -> tuple[int, ...]:
    """For each block the first block of its rigid group; 0 for the static group."""
    first: list[int] = []
    for placed in geometry.blocks:
        begins = placed.step.parent < 0 or placed.two_ended or library()[placed.type].non_stable
        first.append(placed.id if begins else first[placed.step.parent])
    return tuple(first)


def has_locked_joint(geometry: Geometry) -> bool:
    """Whether a closed loop bridges a moving joint and so locks it."""
    group = rigid_groups(geometry) if geometry.auto_connections else ()
    return any(group[loop.block] != group[loop.partner] for loop in geometry.auto_connections)


def build_part(g: Builder, part: Any, dims: Dims) -> None:
    """Build a part step by step as mechanisms.yaml describes."""
    named: dict[str, list[int]] = {}
    for step in part["grow"]:
        if "rule" in step:
            RULES[step["rule"]](g, dims)
        else:
            named[step.get("as", "")] = _build_rows(g, step, dims, named)


def _build_rows(g: Builder, step: Any, dims: Dims, named: Mapping[str, list[int]]) -> list[int]:
    """Build rows of one type from each anchor to each side; the last id of each row."""
    kind, ends, skip = g.choose(*step["types"]), list[int](), step.get("skip", 0)
    starts = named[step["from"]] if step["from"] in named else [_find_anchor(g, step["from"])]
    for at, (side, count) in product(starts[: dims.get(step.get("most"))], step["to"].items()):
        towards = g.geometry[at].facing if side == "out" else side
        end = g.chain(kind, at, towards, dims.get(count, count), dims.get(skip, skip))
        ends += [end] * (end != at)
    return ends


def _find_anchor(g: Builder, name: str) -> int:
    """Where a part starts: the root, the arm's pivot, or the block that reaches farthest."""
    if name in ("root", "pivot"):
        return _find_pivot(g) if name == "pivot" else 0
    axis, sign = "xyz".index(name[0]), 1 if name[1] == "+" else -1
    solid = [b for b in g.geometry.blocks if b.type in (STARTING_BLOCK, *RIGID, *SPARE)]
    return max(solid, key=lambda b: (sign * b.center[axis], -abs(b.center[0]))).id


def _find_pivot(g: Builder) -> int:
    """The block that carries the arm: the joint, or the spacer on its front."""
    joint = max((step.id for step in g.machine if step.type in JOINTS), default=0)
    spacers = [b for b in g.geometry.children(joint) if g.geometry[b].facing == "x+" and joint]
    return max(spacers, default=joint)


def _arm(g: Builder, dims: Dims) -> None:
    pivot = _find_pivot(g)
    g.chain(g.choose(BEAMS, SPARE), pivot, "z+", int(g.machine[pivot].type == HINGE))
    arm = g.chain(g.choose(BEAMS, SPARE), pivot, "z-", dims["segments"])
    mouth = "z-" if dims["container"] > 1 else "y+"
    box = g.chain(g.choose((CONTAINER,)), arm, mouth) if dims["container"] else arm
    g.chain(g.choose((BOULDER,)), box, "y+" if box == arm else mouth)


def _springs(g: Builder, dims: Dims) -> None:
    """From the front end of the lever to low blocks that are not behind it."""
    pivot, blocks = _find_pivot(g), g.geometry.blocks
    front = [b for b in g.geometry.children(pivot) if blocks[b].facing == "z+"]
    tops = [(b, f.face_id) for b in front for f in blocks[b].faces if f.facing != "y+"]
    near, low = [b for b in blocks[:pivot] if b.center[2] > -1], blocks[pivot].center[1] - 1.5
    feet = [(b.id, f.face_id) for b in near for f in b.faces if f.position[1] < low]
    for _ in range(dims["springs"] if tops and feet else 0):
        g.add(g.choose((SPRING,)), g.rng.choice(tops), g.rng.choice(feet))


def _ties(g: Builder, dims: Dims) -> None:
    """From the highest static block to the highest block that a joint moves."""
    group, ends = rigid_groups(g.geometry), [g.geometry[0]]
    for moved in (False, True):
        near = ends[-1].center
        blocks = [b for b in g.geometry.blocks if bool(group[b.id]) == moved and b.faces]
        ends += sorted(blocks, key=lambda b: (-b.box_max[1], dist(b.center, near)))[:1]
    for _ in range(dims["springs"] if len(ends) == 3 else 0):
        g.add(g.choose((SPRING,)), *((b.id, g.rng.choice(b.faces).face_id) for b in ends[1:]))


def _ropes(g: Builder, dims: Dims) -> None:
    """Vertical winches from a block to a block below that a joint moves."""
    group = rigid_groups(g.geometry)
    faces = [(b.id, f) for b in g.geometry.blocks for f in open_faces(g.geometry, b.id, "y")]
    for (a, low), (b, high) in product(faces, faces):
        (x, y, z), (u, v, w) = low.position, high.position
        above = low.facing == "y-" and high.facing == "y+" and (x, z) == (u, w) and y > v
        if above and group[a] < group[b] and g.machine.count(WINCH) < dims["ropes"]:
            g.add(g.choose((WINCH,)), (a, low.face_id), (b, high.face_id))


def _splints(g: Builder, dims: Dims) -> None:
    """Braces along z across every joint of a row of blocks from the root, the middle first."""
    for side in SIDES[: dims["sides"]]:
        faces = sorted(_deck_faces(g, side), key=lambda spot: spot[1].position[2])
        gaps = [pair for pair in pairwise(faces) if pair[0][0] != pair[1][0]]
        for (a, one), (b, other) in sorted(gaps, key=lambda pair: abs(pair[0][1].position[2])):
            g.add(g.choose((BRACE,)), (a, one.face_id), (b, other.face_id))


def _stays(g: Builder, dims: Dims) -> None:
    """Braces from the foot of the lowest block to the underside of the deck, the ends first."""
    post = min(g.geometry.blocks, key=lambda b: (b.center[1], b.id))
    feet = open_faces(g.geometry, post.id, "y-")[:1]
    faces = [spot for spot in _deck_faces(g, "y-") if spot[0] != post.id]
    for foot, towards in product(feet, (1, -1)):
        ahead = [spot for spot in faces if towards * spot[1].position[2] > 1]
        ahead.sort(key=lambda spot: -abs(spot[1].position[2]))
        for b, face in ahead[1 : 1 + dims["ties"]]:
            g.add(g.choose((BRACE,)), (post.id, foot.face_id), (b, face.face_id))


def _deck_faces(g: Builder, side: str) -> list[tuple[int, PlacedFace]]:
    """Block and face on one side of the row of blocks along z through the root, without its own."""
    row = [b for b in g.geometry.blocks if b.id and b.faces and b.center[:2] == (0, 0)]
    return [(b.id, face) for b in row for face in b.faces if face.facing == side]


def _masts(g: Builder, dims: Dims) -> None:
    """On the cubes beside the root, alike on both sides."""
    mast = g.choose((63, 1))
    for side in [b.id for b in g.geometry.blocks if (abs(b.center[0]), *b.center[1:]) == (1, 0, 0)]:
        top = g.chain(mast, side, "y+")
        g.chain(g.choose((BALLAST,)), top, "y+", dims["ballast"])


def _wheels(g: Builder, dims: Dims) -> None:
    """In pairs, farthest from the root first."""
    faces = [(b.id, f) for b in g.geometry.blocks for f in open_faces(g.geometry, b.id, "x")]
    spots = {(f.position, f.facing): (b, f.face_id) for b, f in faces if abs(f.position[1]) < 0.6}
    wheel, axles = g.choose(WHEELS), 0
    for (x, y, z), facing in sorted(spots, key=lambda spot: -hypot(*spot[0])):
        twin = spots.get(((-x, y, z), "x-"))
        if facing == "x+" and twin and axles < dims["axles"]:
            axles += bool(g.add(wheel, spots[(x, y, z), facing]) and g.add(wheel, twin))


def _anything(g: Builder, dims: Dims) -> None:
    kinds = [kind for kind in sorted(g.types) if kind and not library()[kind].linear]
    for _ in range(dims["blocks"]):
        spots = [(b.id, f.face_id) for b in g.geometry.blocks for f in open_faces(g.geometry, b.id)]
        g.add(g.choose(kinds), g.rng.choice(spots or [(0, 0)]))


RULES = {
    rule.__name__[1:]: rule
    for rule in (_arm, _springs, _ties, _ropes, _splints, _stays, _masts, _wheels, _anything)
}
"""Rules for parts that are not rows of blocks, by their name in mechanisms.yaml."""
