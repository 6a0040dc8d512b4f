"""Plates, the roots of gear trains: block types whose number encodes their size and holes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from random import Random

from agentflow.errors import ConfigError
from agentflow.machine.blocks.types import BlockType, Face

GRID = 0.5
"""Spacing of the faces, m."""
THICKNESS = 0.5
"""m."""
DENSITY = 1.0
"""kg per square metre; cogs that turn on a plate this heavy do not move it."""
COLOR = (0.56, 0.6, 0.62, 1.0)
HOLE = 2.0
"""Width of a hole, m."""
SIZES, HOLES, PATTERNS = (5, 31), (0, 20), (0, 9)
"""Ranges of the width (whole metres), the number of holes and the pattern."""


@dataclass(frozen=True)
class Plate:
    """A square plate in the x-z plane.

    Its faces lie on all points of a 0.5 m grid inside it, point Up and are numbered row by row,
    x first, from the corner with the lowest x and z. Holes are 2 m squares with their centres on
    the grid; nothing can be attached to faces within a hole or on its rim.
    """

    size: int
    """Width along x and z, m."""
    holes: int = 0
    pattern: int = 0
    """One of ten random arrangements of the holes."""

    @property
    def type(self) -> int:
        """Its type number: the size, two digits for the holes, one for the pattern."""
        return 1000 * self.size + 10 * self.holes + self.pattern

    @property
    def row_length(self) -> int:
        """Faces in a row."""
        return 2 * self.size - 1

    def face(self, x: float, z: float) -> int:
        """The face at x and z, m from the plate's middle.

        Raises:
            ConfigError: The place is off the plate or over a hole.
        """
        column, line = (round(part / GRID) + self.row_length // 2 for part in (x, z))
        if not (0 <= column < self.row_length and 0 <= line < self.row_length):
            raise ConfigError(f"x = {x:g}, z = {z:g} m is not on a plate {self.size} m wide")
        face = line * self.row_length + column
        if face in plate_type(self.type).closed:
            raise ConfigError(f"x = {x:g}, z = {z:g} m is over a hole of the plate")
        return face

    def face_position(self, face: int) -> tuple[float, float]:
        """x and z of a face, m from the plate's middle."""
        line, column = divmod(face, self.row_length)
        return (column - self.row_length // 2) * GRID, (line - self.row_length // 2) * GRID

    @property
    def hole_centres(self) -> tuple[tuple[float, float], ...]:
        """x and z of the middle of each hole, m; holes touch neither each other nor the edge."""
        rng = Random(f"plate {self.type}")
        centres: list[tuple[int, int]] = []
        limit = self.row_length // 2 - 4
        places = [(x, z) for x in range(-limit, limit + 1, 2) for z in range(-limit, limit + 1, 2)]
        rng.shuffle(places)
        for x, z in places:
            if len(centres) == self.holes:
                break
            if all(max(abs(x - u), abs(z - v)) > 6 for u, v in centres):
                centres.append((x, z))
        return tuple((x * GRID, z * GRID) for x, z in sorted(centres))

    def block_type(self) -> BlockType:
        """The plate as a block type."""
        centres = self.hole_centres
        places = [self.face_position(face) for face in range(self.row_length**2)]
        closed = {
            face
            for face, (x, z) in enumerate(places)
            for u, v in centres
            if max(abs(x - u), abs(z - v)) <= HOLE / 2
        }
        return BlockType(
            type=self.type,
            name="Plate",
            category="Plate",
            size=(float(self.size), THICKNESS, float(self.size)),
            mass=DENSITY * self.size**2,
            faces=tuple(Face(i, (x, THICKNESS / 2, z), "Up") for i, (x, z) in enumerate(places)),
            color=COLOR,
            shape="plate",
            extended=True,
            closed=frozenset(closed),
        )


def plate_of(block_type: int) -> Plate | None:
    """The plate with this type number; None if no plate has it."""
    if block_type < 1000:  # nearly always
        return None
    size, rest = divmod(block_type, 1000)
    plate = Plate(size, *divmod(rest, 10))
    ranges = ((size, SIZES), (plate.holes, HOLES), (plate.pattern, PATTERNS))
    return plate if all(low <= value <= high for value, (low, high) in ranges) else None


@lru_cache(maxsize=32)
def plate_type(block_type: int) -> BlockType:
    """The plate of this number as a block type.

    Raises:
        KeyError: No plate has this number.
    """
    plate = plate_of(block_type)
    if plate is None:
        raise KeyError(block_type)
    return plate.block_type()
