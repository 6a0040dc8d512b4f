"""Spring-dampers of joints that close loops: engines have no joint there, so these are forces."""

from __future__ import annotations

from collections.abc import Sequence

from agentflow.env.physics.frames import swap
from agentflow.env.physics.laws.forces import PartForce, PartLocations, part_motion
from agentflow.env.physics.model import Assembly
from agentflow.env.physics.rows import Row
from agentflow.machine.geometry.vectors import Vec3, add, dot, rotate_vector, scale, subtract


class Struts:
    """The sprung joints among those that close loops."""

    def __init__(self, assembly: Assembly, loops: Sequence[int], locations: PartLocations) -> None:
        """Set up.

        Args:
            assembly: The machine.
            loops: Joints that close loops.
            locations: Where the parts are.
        """
        sprung = [assembly.joints[i] for i in loops if assembly.joints[i].drive.stiffness]

        def place(part: int, pivot: Vec3) -> tuple[int, Vec3]:
            row, offset = locations.locate(part)
            return row, add(offset, swap(subtract(pivot, assembly.parts[part].centre)))

        self._struts = [
            (joint, place(joint.a, joint.pivot), place(joint.b, joint.pivot), swap(joint.axis))
            for joint in sprung
        ]

    def __bool__(self) -> bool:
        return bool(self._struts)

    def __call__(self, rows: Sequence[Row]) -> list[PartForce]:
        """What they do in this step; both parts are pushed in one line."""
        pushes = []
        for joint, (row_a, offset_a), (row_b, offset_b), axis in self._struts:
            at_a, speed_a = part_motion(rows[row_a], offset_a)
            at_b, speed_b = part_motion(rows[row_b], offset_b)
            x, y, z, w = rows[row_a][3:7]
            along = rotate_vector((x, y, z, w), axis)
            position = dot(subtract(at_b, at_a), along)
            rate = dot(subtract(speed_b, speed_a), along)
            size = -joint.drive.stiffness * position - joint.drive.damping * rate
            force = scale(along, size)
            pushes += [
                PartForce(joint.b, force, at_b),
                PartForce(joint.a, scale(force, -1.0), at_b),
            ]
        return pushes
