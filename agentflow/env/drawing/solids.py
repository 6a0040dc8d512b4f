"""The coloured solids of a machine in any pose, as scene objects."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace

import numpy as np

from agentflow.env.constants import constants
from agentflow.env.drawing.cameras import to_vec3
from agentflow.env.physics.assembly import assemble
from agentflow.env.physics.model import Assembly, Color
from agentflow.env.rollout import Array, Trace
from agentflow.env.rotations import compose, conjugate, rotate, rotated_axes
from agentflow.env.scene import SceneObject, Start
from agentflow.machine.geometry import vectors
from agentflow.machine.geometry.placement import place
from agentflow.machine.tree import Machine

BROKEN: Color = (0.85, 0.1, 0.1, 1.0)
"""Differs from the boulder's colour, so that both can be seen."""
SPOKE: Color = (0.75, 0.72, 0.62, 1.0)
SPOKE_WIDTH, SPOKE_RISE = 0.14, 0.02
"""Width and height of the bar on a wheel that shows its rotation, m."""
ROD_DIAMETER = 0.18
"""Diameter of two-ended blocks, m."""


@dataclass(frozen=True)
class Pose:
    """Positions (N, 3) and orientations (N, 4) of a machine's blocks at one moment; `alive` are
    those that are still connected to their parent."""

    centre: Array
    rotation: Array
    alive: Collection[int]

    @classmethod
    def at(cls, trace: Trace, index: int) -> Pose:
        """The pose in one sample."""
        alive = set(np.flatnonzero(trace.alive[index]).tolist())
        return cls(trace.centre[index], trace.rotation[index], alive)

    def at_start(self, start: Start) -> Pose:
        """This pose, if it is that of a machine as built, where the machine starts in a level."""
        centre = self.centre @ rotated_axes(start.rotation) + (0.0, start.height, 0.0)
        turned = compose(np.asarray(start.rotation), self.rotation)
        return Pose(centre, turned, self.alive)


class MachineSolids:
    """The solids of one machine.

    `solids` holds each block's solids in the block's own frame, relative to its centre; () for
    two-ended blocks, because their length changes.
    """

    def __init__(self, machine: Machine) -> None:
        geometry = place(machine)
        assembly = assemble(machine, geometry, constants())
        self._machine = machine
        centres, rotations = np.asarray(assembly.centres), np.asarray(assembly.rotations)
        self.rest = Pose(centres, rotations, range(len(machine)))
        """As built: standing on the ground, not settled."""
        self.solids = tuple(
            () if step.two_ended else tuple(self._solids(step.id, assembly)) for step in machine
        )
        self._grown = 2 * float(constants()["shrink"])
        self._colors = [assembly.parts[parts[0]].color for parts in assembly.blocks]
        shift = centres[0] - geometry.blocks[0].center
        self.ends = {
            rod.id: tuple(
                rotate(conjugate(rotations[parent]), np.asarray(end) + shift - centres[parent])
                for parent, end in zip(machine[rod.id].parents, (rod.end_a, rod.end_b), strict=True)
            )
            for rod in geometry.blocks
            if rod.two_ended
        }
        """Two-ended block -> both ends, each in the frame of the parent that it is attached to."""

    def objects(self, pose: Pose, red: Collection[int] = ()) -> list[SceneObject]:
        """The solids in a pose, named by block; blocks in `red` are red.

        Boxes are as large as they are built, so that neighbours touch.
        """
        result: list[SceneObject] = []
        for step in self._machine:
            if step.two_ended:
                solids = [self.rod(step.id, pose)] if step.id in pose.alive else []
            else:
                place = to_vec3(pose.centre[step.id]), _quat(pose.rotation[step.id])
                solids = [_to_world(self._full(solid), *place) for solid in self.solids[step.id]]
            result += (replace(s, color=BROKEN) for s in solids) if step.id in red else solids
        return result

    def _full(self, solid: SceneObject) -> SceneObject:
        if solid.shape != "box" or solid.color == SPOKE:
            return solid
        x, y, z = solid.size
        return replace(solid, size=(x + self._grown, y + self._grown, z + self._grown))

    def rod(self, block: int, pose: Pose) -> SceneObject:
        """The cylinder that shows a two-ended block."""
        a, b = (
            pose.centre[parent] + rotate(pose.rotation[parent], end)
            for parent, end in zip(self._machine[block].parents, self.ends[block], strict=True)
        )
        length = max(float(np.linalg.norm(b - a)), 1e-3)
        along = vectors.rotation_from_up(to_vec3(b - a)) if length > 1e-3 else (0.0, 0.0, 0.0, 1.0)
        size = (ROD_DIAMETER, length, ROD_DIAMETER)
        color = self._colors[block]
        return SceneObject(
            f"block {block}", "cylinder", size, to_vec3((a + b) / 2), along, color=color
        )

    def _solids(self, block: int, assembly: Assembly) -> Iterator[SceneObject]:
        back = conjugate(self.rest.rotation[block])
        for part in (assembly.parts[index] for index in assembly.blocks[block]):
            for shape in part.shapes:
                offset = np.add(part.centre, shape.offset) - self.rest.centre[block]
                rotation = _quat(compose(back, np.asarray(shape.rotation)))
                position = to_vec3(rotate(back, offset))
                name, color = f"block {block}", part.color
                yield SceneObject(name, shape.kind, shape.size, position, rotation, color=color)
                if shape.kind == "cylinder":
                    spoke = (0.8 * shape.size[0], shape.size[1] + SPOKE_RISE, SPOKE_WIDTH)
                    yield SceneObject(name, "box", spoke, position, rotation, color=SPOKE)


def _to_world(item: SceneObject, centre: vectors.Vec3, rotation: vectors.Quat) -> SceneObject:
    """Transform an object from a block's frame to the world."""
    position = vectors.add(centre, vectors.rotate_vector(rotation, item.position))
    return replace(item, position=position, rotation=vectors.product(rotation, item.rotation))


def _quat(rotation: Array) -> vectors.Quat:
    x, y, z, w = (float(v) for v in rotation)
    return (x, y, z, w)
