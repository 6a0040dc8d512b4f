"""Owns the mechanisms: the parts of each, what is told about them, and how each part grows.

No machine is stored: a part is a rule over drawn dimensions, and what does not fit is left out.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass

from agentflow.llm.procedural.growth import Growth
from agentflow.machine.blocks import BOULDER, CONTAINER, library
from agentflow.machine.brief import Brief

Dims = Mapping[str, int]
BEAMS = (1, 63, 41)
HINGE, SPRING, CUBE, MOTOR, BALLAST = 5, 9, 15, 22, 35
WHEELS = (2, 46)


@dataclass(frozen=True)
class Part:
    """One structure: what it is for, the types it may use, the ranges of its dimensions."""

    name: str
    duty: str
    slots: tuple[tuple[int, ...], ...]
    """Per slot the types that can fill it."""
    guidance: str
    ranges: Mapping[str, tuple[int, int]]
    """Dimension -> least and most, counted in blocks; honest ranges, from which chance draws."""
    grow: Callable[[Growth, Dims], None]


@dataclass(frozen=True)
class Mechanism:
    """A way to do a task: its parts in building order."""

    name: str
    idea: str
    parts: tuple[Part, ...]

    def fits(self, types: Collection[int]) -> bool:
        """Whether every part can be built from these types."""
        return all(set(slot) & set(types) for part in self.parts for slot in part.slots[:1])


def _base(g: Growth, dims: Dims) -> None:
    beam = g.choose(BEAMS) or g.choose((CUBE,))
    ends = [
        g.chain(beam, 0, "z+", dims["beams ahead"]),
        g.chain(beam, 0, "z-", dims["beams behind"]),
        g.chain(beam, 0, "x+", dims["beams aside"]),
        g.chain(beam, 0, "x-", dims["beams aside"]),
    ]
    for end in ends[: dims["feet"]]:
        for side in ("x+", "x-"):
            g.hang(beam, end, side)
    for index in range(dims["ballast"]):
        g.hang(g.choose((BALLAST,)), ends[index % 4], "y+")


def _column(g: Growth, storeys: int) -> int:
    """A column on the root; the id of its top."""
    return g.chain(g.choose(BEAMS) or g.choose((CUBE,)), 0, "y+", storeys)


def _motor_tower(g: Growth, dims: Dims) -> None:
    top = _column(g, dims["storeys"])
    g.hang(g.choose((MOTOR,)), top, "x+", dims["steps below the top"])


def _payload(g: Growth, arm: int, dims: Dims) -> None:
    """Container and boulder: at the arm's end with the mouth outward, or on top of it."""
    on_top = dims["container"] == 0
    box = g.hang(g.choose((CONTAINER,)), arm, "y+" if on_top else "z-")
    g.hang(g.choose((BOULDER,)), arm if box is None else box, "y+" if on_top else "z-")


def _arm(g: Growth, dims: Dims) -> None:
    pivot = max(g.of(MOTOR, HINGE), default=0)
    _payload(g, g.chain(g.choose(BEAMS), pivot, "z-", dims["arm segments"]), dims)


def _counterweight(g: Growth, dims: Dims) -> None:
    pivot = max(g.of(MOTOR, HINGE), default=0)
    lever = g.hang(g.choose((CUBE, 1)), pivot, "z+")
    g.chain(g.choose((BALLAST,)), pivot if lever is None else lever, "z+", dims["weights"])


def _hinge_tower(g: Growth, dims: Dims) -> None:
    top = _column(g, dims["storeys"])
    g.hang(g.choose((HINGE,)), top, "y+")
    g.hang(g.choose(BEAMS), top, "z-")


def _lever(g: Growth, dims: Dims) -> None:
    pivot = max(g.of(HINGE, MOTOR), default=0)
    g.hang(g.choose(BEAMS), pivot, "z+")
    _arm(g, dims)


def _springs(g: Growth, dims: Dims) -> None:
    pivot = max(g.of(HINGE, MOTOR), default=0)
    for _ in range(dims["springs"]):
        pair = spring_ends(g, pivot)
        if pair:
            g.add(g.choose((SPRING,)), *pair)


def spring_ends(g: Growth, pivot: int) -> tuple[tuple[int, int], tuple[int, int]] | None:
    """Two faces between which a spring lifts the arm: its front lever, and the base below."""
    height = g.geometry[pivot].center[1]
    levers = [b for b in g.geometry.children(pivot) if g.geometry[b].facing == "z+"]
    tops = [(b, f.face_id) for b in levers for f in g.geometry[b].faces if f.facing != "y+"]
    feet = [
        (placed.id, face.face_id)
        for placed in g.geometry.blocks[:pivot]
        for face in placed.faces
        if placed.center[1] < height - 1.5 and placed.center[2] > -0.6 and face.facing != "y-"
    ]
    return (g.chance.choice(tops), g.chance.choice(feet)) if tops and feet else None


def _chassis(g: Growth, dims: Dims) -> None:
    beam = g.choose((*BEAMS, CUBE))
    nose = g.chain(beam, 0, "z+", dims["beams ahead"])
    tail = g.chain(beam, 0, "z-", dims["beams behind"])
    for end in (nose, tail) if dims["cross beams"] else ():
        for side in ("x+", "x-"):
            g.hang(beam, end, side)
    for end in (nose, tail)[: dims["ballast"]]:
        g.hang(g.choose((BALLAST,)), end, "y+")


def _wheels(g: Growth, dims: Dims) -> None:
    wheel = g.choose(WHEELS)
    outer = sorted(
        (f.position[2], -abs(f.position[0]), f.facing, block.id, f.face_id)
        for block in g.geometry.blocks
        for f in g.free(block.id)
        if f.facing in ("x+", "x-") and abs(f.position[1]) < 0.6
    )
    stations = sorted({spot[0] for spot in outer}, key=lambda z: (-abs(z), z))
    for z in stations[:2] if dims["axles"] == 2 else stations:
        for facing in ("x+", "x-"):
            if len(g.of(*WHEELS)) < 2 * dims["axles"]:
                spots = [spot for spot in outer if spot[0] == z and spot[2] == facing]
                any(g.add(wheel, spot[3:]) is not None for spot in spots[:2])


def scatter(g: Growth, dims: Dims) -> None:
    """Hang blocks of any allowed type anywhere; the last resort for tasks nobody knows."""
    kinds = [k for k in sorted(g.types) if k and not library()[k].linear]
    for _ in range(dims["blocks"] if kinds else 0):
        spots = [(b.id, f.face_id) for b in g.geometry.blocks for f in g.free(b.id)]
        g.add(g.chance.choice(kinds), g.chance.choice(spots))


BASE = Part(
    "Base",
    "a wide cross of beams on the ground that keeps the machine from tipping",
    (BEAMS, (CUBE,), (BALLAST,)),
    "Lay beams flat from the root to all sides, cross beams as feet at their ends, ballast on top.",
    {"beams ahead": (1, 2), "beams behind": (1, 2), "beams aside": (1, 2), "feet": (0, 2),
     "ballast": (0, 3)},
    _base,
)  # fmt: skip
MOTOR_TOWER = Part(
    "Motor tower",
    "a column that carries a rotating block high enough for the arm",
    ((MOTOR,), BEAMS),
    "Stack a column on the root; on its x+ side near the top a rotating block that faces x+.",
    {"storeys": (1, 2), "steps below the top": (0, 1)},
    _motor_tower,
)
ARM = Part(
    "Throwing arm",
    "an arm that swings from the back over the top to the front and holds the boulder",
    (BEAMS, (CONTAINER,), (BOULDER,)),
    "From the pivot lay the arm towards z-. At its end a container with the boulder in it: "
    "container 1 looks outward, container 0 lies on the arm and looks up.",
    {"arm segments": (1, 2), "container": (0, 1)},
    _arm,
)
COUNTERWEIGHT = Part(
    "Counterweight",
    "ballast that balances the loaded arm, so that the motor need not lift it",
    ((BALLAST,), (CUBE, 1)),
    "On the z+ side of the rotating block, opposite the arm, a short lever and weights on it.",
    {"weights": (1, 3)},
    _counterweight,
)
HINGE_TOWER = Part(
    "Hinge tower",
    "a column with a free hinge on top and a shelf on which the arm rests before t = 0",
    ((HINGE,), BEAMS),
    "Stack a column on the root, a hinge that faces y+ on its top, and right below the arm a "
    "beam towards z- as a shelf.",
    {"storeys": (1, 2)},
    _hinge_tower,
)
LEVER = Part(
    "Lever",
    "a two-sided lever on the hinge: a front end to be pulled down, a rear end with the boulder",
    (BEAMS, (CONTAINER,), (BOULDER,)),
    f"From the hinge a beam towards z+ for the springs. {ARM.guidance}",
    ARM.ranges,
    _lever,
)
SPRINGS = Part(
    "Springs",
    "springs that pull the front end of the lever down to the base",
    ((SPRING,),),
    "From the front end of the lever to low blocks of the base and the column, as long as can be.",
    {"springs": (1, 4)},
    _springs,
)
CHASSIS = Part(
    "Chassis",
    "a straight spine along z that carries the wheels",
    ((*BEAMS, CUBE), (BALLAST,)),
    "Beams from the root to z+ and z-; cross beams (1) or none (0) at both ends; ballast on top.",
    {"beams ahead": (1, 2), "beams behind": (1, 2), "cross beams": (0, 1), "ballast": (0, 2)},
    _chassis,
)
WHEEL_SET = Part(
    "Wheels",
    "powered wheels in pairs on both sides",
    (WHEELS,),
    "Powered wheels on the x+ and x- faces, in pairs, the outermost stations first.",
    {"axles": (2, 4)},
    _wheels,
)
LOOSE = Part("Frame", "whatever these blocks allow", ((),), "Hang blocks side by side.",
             {"blocks": (3, 8)}, scatter)  # fmt: skip

THROWERS = (
    Mechanism("motor arm", "A rotating block swings an arm that flings the boulder to z+.",
              (BASE, MOTOR_TOWER, ARM)),
    Mechanism("counterweight arm", "A rotating block swings an arm balanced by ballast.",
              (BASE, MOTOR_TOWER, ARM, COUNTERWEIGHT)),
    Mechanism("spring arm", "Springs pull down the front of a hinged lever; its rear throws.",
              (BASE, HINGE_TOWER, LEVER, SPRINGS)),
)  # fmt: skip
CAR = Mechanism("car", "Powered wheels on both sides of a chassis drive it to z+.",
                (CHASSIS, WHEEL_SET))  # fmt: skip
FRAME = Mechanism("frame", "A frame of what is allowed.", (LOOSE,))
PARTS = {part.name: part for m in (*THROWERS, CAR, FRAME) for part in m.parts}


def suited(brief: Brief) -> list[Mechanism]:
    """The mechanisms that serve a task and can be built from its blocks; at least one."""
    throwers = THROWERS if BOULDER in brief.required else ()
    fitting = [mechanism for mechanism in throwers if mechanism.fits(brief.blocks)]
    return fitting or ([CAR] if CAR.fits(brief.blocks) else [FRAME])
