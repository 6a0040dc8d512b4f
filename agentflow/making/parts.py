"""What is made of each block: solid shapes in its own frame, and where they go; how large, and
with which pegs.

Metres, in the right-handed frame with z up (`env.physics.frames`); the machine stands on z = 0.
Shapes have the sizes of the block library, without the gaps that simulated ones leave. Hinges are
whole blocks, so that all of their faces are there. Two-ended blocks are rods from face to face.
"""

import re
from dataclasses import dataclass
from functools import cache

from agentflow.env.constants import constants
from agentflow.env.physics.assembly.parts import ROD_DIAMETER, block_parts
from agentflow.env.physics.frames import swap, swap_quaternion
from agentflow.env.physics.model import Shape
from agentflow.errors import UsageError
from agentflow.machine import BlockType, Geometry, Machine, Step, library, place
from agentflow.machine.geometry import vectors
from agentflow.machine.geometry.placement import place_step
from agentflow.machine.geometry.pose import Placed

PRINTED, FULL = 20.0, 1.0
"""Scales by default, 1 : N: of files for printers, and of others."""
LEAST, MOST = 1.0, 1000.0
THICKEST = 100.0
"""Thickest peg, mm."""


@dataclass(frozen=True)
class Making:
    """What was asked for; None and False stand for what is usual in a format.

    The scale is N of 1 : N. `pegs` is the diameter of pegs in mm, which parts get where they are
    attached, with holes for them. `parts` says whether each block is a part of its own, which pegs
    need.
    """

    scale: float | None = None
    pegs: float | None = None
    parts: bool = False

    def millimetres(self, usual: float) -> float:
        """mm of the made machine per m, with the scale that is usual in a format."""
        return 1000.0 / (self.scale or usual)


USUAL = Making()


def making(scale: float | None = None, pegs: str | None = None, *, parts: bool = False) -> Making:
    """What options ask for.

    Raises:
        UsageError: The scale or the pegs are none.
    """
    if scale is not None and not LEAST <= scale <= MOST:
        raise UsageError(
            f"--scale {scale:g} is no scale: give a number from {LEAST:g} to {MOST:g}, such as "
            f"{PRINTED:g} for 1 : {PRINTED:g}"
        )
    if pegs is None:
        return Making(scale, parts=parts)
    found = re.fullmatch(r"(\d+(?:\.\d*)?|\.\d+)\s*(?:mm)?", pegs.strip())
    if found is None or not 0.0 < float(found[1]) <= THICKEST:
        raise UsageError(
            f"--pegs {pegs!r} is no diameter: give millimetres up to {THICKEST:g}, such as 5mm"
        )
    return Making(scale, float(found[1]), parts=True)


SHORTEST = 1e-3
"""Least length of a rod, m: both ends of a two-ended block may be at one place."""
ORIGIN: vectors.Vec3 = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Part:
    """One block to make. Parts whose `kind` and `shapes` are equal are the same."""

    block: int
    kind: BlockType
    shapes: tuple[Shape, ...]
    """In its own frame, about the centre of its box; cylinders lie along z."""
    at: vectors.Vec3
    rotation: vectors.Quat

    @property
    def name(self) -> str:
        """Such as block_3_powered_wheel."""
        return f"block_{self.block}_{type_name(self.kind)}"

    @property
    def rod_length(self) -> float | None:
        """Length of a two-ended block, m; None for others."""
        return self.shapes[0].size[2] if self.kind.linear else None


def type_name(kind: BlockType) -> str:
    """The name of a block type in files, such as powered_wheel."""
    return kind.name.lower().replace(" ", "_")


def parts_of(machine: Machine) -> tuple[Part, ...]:
    """The parts of a file-valid machine, in order of id."""
    geometry = place(machine)
    shift = shift_of(geometry)
    return tuple(_part(placed, shift) for placed in geometry.blocks)


def shift_of(geometry: Geometry) -> vectors.Vec3:
    """From the machine frame to where the machine stands, above the origin; game frame, m."""
    x, _, z = geometry.middle
    return (-x, -geometry.box_min[1], -z)


def _part(placed: Placed, shift: vectors.Vec3) -> Part:
    kind, at = library()[placed.type], swap(vectors.add(placed.center, shift))
    if placed.end_a is None or placed.end_b is None:
        return Part(placed.id, kind, block_shapes(kind), at, swap_quaternion(placed.quaternion))
    line = vectors.subtract(placed.end_b, placed.end_a)
    size = round(vectors.length(line), 9)
    turn = vectors.rotation_from_up(line if size > SHORTEST else (0.0, 1.0, 0.0))
    rod = Shape("cylinder", (ROD_DIAMETER, ROD_DIAMETER, max(size, SHORTEST)))
    return Part(placed.id, kind, (rod,), at, swap_quaternion(turn))


@cache
def block_shapes(kind: BlockType) -> tuple[Shape, ...]:
    """The shapes of a block with one parent, as it faces z+ in the game frame."""
    assert kind.size is not None
    if kind.shape == "hinge":
        return (Shape("box", swap(kind.size)),)
    placed = place_step(Step(0, kind.type, -1, -1), {})
    exact = constants().changed({"shrink": 0.0})
    return tuple(
        Shape(
            shape.kind,
            swap(shape.size),
            swap(vectors.subtract(vectors.add(part.centre, shape.offset), placed.center)),
            swap_quaternion(shape.rotation),
        )
        for part in block_parts(placed, kind, exact, ORIGIN)
        for shape in part.shapes
    )
