"""Owns what a picture holds: the coloured solids of a machine at one moment of a trace.

They are plain scene things, so that any engine can draw them; cameras are views.py's, files are
render.py's.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, replace
from math import cos, pi, sin, tan

import numpy as np

from agentflow.env.constants import constants
from agentflow.env.engines.assembly import assemble
from agentflow.env.engines.base import Assembly, Color
from agentflow.env.engines.vectors import upright_to
from agentflow.env.rotations import chain, inverse, rotate
from agentflow.env.scene import Quat, Thing, Vec3
from agentflow.env.trace import Array
from agentflow.machine.blocks import CONTAINER
from agentflow.machine.geometry import Geometry, place
from agentflow.machine.tree import Machine

BROKEN: Color = (0.85, 0.1, 0.1, 1.0)
CONTAINER_COLOR: Color = (0.52, 0.38, 0.22, 1.0)
"""Unlike the boulder's, which lies in it."""
SPOKE: Color = (0.75, 0.72, 0.62, 1.0)
SIDES = 12
"""Of the prisms that wheels are drawn as."""
GAP = 0.03
"""By which boxes are drawn smaller, so that every block shows its outline, m."""
ROD_DIAMETER = 0.18
"""Of what two-ended blocks are drawn as, m."""
TINTS = (1.0, 0.9, 1.08, 0.95)
"""Brightness of neighbouring blocks, so that their edges show."""


@dataclass(frozen=True)
class Pose:
    """Where the blocks of a machine are at one moment."""

    centre: Array
    """(N, 3) m."""
    rotation: Array
    """(N, 4)."""
    alive: Collection[int]
    """Blocks that still hang on their parent."""


class Figures:
    """The shapes of one machine, ready to be put into any pose."""

    def __init__(self, machine: Machine) -> None:
        geometry = place(machine)
        self._machine = machine
        self._assembly = assemble(machine, geometry, constants())
        self._ends = _ends(geometry, self._assembly)

    @property
    def rest(self) -> Pose:
        """As built: standing on the ground, not settled."""
        shape = np.asarray(self._assembly.centres), np.asarray(self._assembly.rotations)
        return Pose(*shape, alive=range(len(self._machine)))

    def things(self, pose: Pose, red: Collection[int] = ()) -> list[Thing]:
        """The machine's solids; blocks in `red` are drawn in red."""
        rest = self.rest
        turn = chain(pose.rotation, inverse(rest.rotation))
        found = []
        for step in self._machine:
            tint = TINTS[step.id % len(TINTS)]
            solids: Iterable[Thing] = ()
            if not step.two_ended:
                solids = self._solids(step.id, pose.centre[step.id], turn[step.id], rest)
            elif step.id in pose.alive:
                solids = self._rod(step.id, step.parents, pose, turn)
            for index, solid in enumerate(solids):
                color = BROKEN if step.id in red else _tinted(solid.color, tint)
                found.append(replace(solid, name=f"block {step.id}.{index}", color=color))
        return found

    def _solids(self, block: int, centre: Array, turn: Array, rest: Pose) -> Iterator[Thing]:
        own = CONTAINER_COLOR if self._machine[block].type == CONTAINER else None
        for part in (self._assembly.parts[index] for index in self._assembly.blocks[block]):
            for shape in part.shapes:
                offset = np.add(part.centre, shape.offset) - rest.centre[block]
                position = _vec3(centre + rotate(turn, offset))
                rotation = chain(turn, np.asarray(shape.rotation))
                color = own or part.color
                if shape.kind == "cylinder":
                    yield from _prism(shape.size, position, rotation, color)
                else:
                    size = _shrunk(shape.size) if shape.kind == "box" else shape.size
                    yield Thing("", shape.kind, size, position, _quat(rotation), color=color)

    def _rod(
        self, block: int, parents: tuple[int, ...], pose: Pose, turn: Array
    ) -> Iterator[Thing]:
        rest = self.rest
        a, b = (
            pose.centre[parent] + rotate(turn[parent], end - rest.centre[parent])
            for parent, end in zip(parents, self._ends[block], strict=True)
        )
        length = float(np.linalg.norm(b - a))
        if length > ROD_DIAMETER:
            color = self._assembly.parts[self._assembly.blocks[block][0]].color
            along = upright_to(_vec3(b - a))
            size = (ROD_DIAMETER, length, ROD_DIAMETER)
            yield Thing("", "cylinder", size, _vec3((a + b) / 2), along, color=color)


def _ends(geometry: Geometry, assembly: Assembly) -> dict[int, tuple[Array, Array]]:
    """End points of the two-ended blocks as built, in the world."""
    shift = np.subtract(assembly.centres[0], geometry.blocks[0].center)
    return {
        placed.id: (np.asarray(placed.end_a) + shift, np.asarray(placed.end_b) + shift)
        for placed in geometry.blocks
        if placed.two_ended
    }


def _prism(size: Vec3, position: Vec3, rotation: Array, color: Color) -> Iterator[Thing]:
    """A cylinder about its y as crossed boxes, whose flat faces show, with a spoke that turns."""
    diameter, length, _ = size
    width = diameter * tan(pi / SIDES)
    spoke = Thing(
        "", "box", (0.8 * diameter, length + 0.02, 0.14), position, _quat(rotation), color=SPOKE
    )
    for index in range(SIDES // 2):
        half = pi * index / SIDES
        turned = chain(rotation, np.array([0.0, sin(half), 0.0, cos(half)]))
        across = (diameter, length, width)
        yield Thing("", "box", across, position, _quat(turned), color=color)
    yield spoke


def _shrunk(size: Vec3) -> Vec3:
    return (size[0] - GAP, size[1] - GAP, size[2] - GAP) if min(size) > 3 * GAP else size


def _quat(rotation: Array) -> Quat:
    x, y, z, w = (float(v) for v in rotation)
    return (x, y, z, w)


def _vec3(values: Array) -> Vec3:
    return (float(values[0]), float(values[1]), float(values[2]))


def _tinted(color: Color, tint: float) -> Color:
    r, g, b, a = color
    return (min(1.0, r * tint), min(1.0, g * tint), min(1.0, b * tint), a)
