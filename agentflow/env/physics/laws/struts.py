"""Spring-dampers of joints that close loops: engines have no joint there, so these are forces."""

from __future__ import annotations

from collections.abc import Sequence

from agentflow.env.physics.frames import swap
from agentflow.env.physics.laws.forces import PartForce, PartLocations, part_motion
from agentflow.env.physics.laws.tension import opposite_forces
from agentflow.env.physics.model import Assembly
from agentflow.env.physics.rows import Row
from agentflow.env.physics.spanning_tree import Loop
from agentflow.machine.geometry.vectors import Vec3, add, dot, rotate_vector, scale, subtract


class StrutForce:
    """Forces of all sprung joints that close loops."""

    def __init__(self, assembly: Assembly, loops: Sequence[Loop], locations: PartLocations) -> None:
        """Pick the sprung joints among `loops`, the joints that close loops."""

        def place(part: int, pivot: Vec3) -> tuple[int, Vec3]:
            row, offset = locations.locate(part)
            return row, add(offset, swap(subtract(pivot, assembly.parts[part].centre)))

        self._struts = [
            (joint, place(joint.a, joint.pivot), place(joint.b, joint.pivot), swap(joint.axis))
            for joint in (assembly.joints[loop.joint] for loop in loops)
            if joint.drive.stiffness
        ]

    def __bool__(self) -> bool:
        return bool(self._struts)

    def __call__(self, rows: Sequence[Row]) -> list[PartForce]:
        """Forces in this step, on one line, as both act at the pivot on part `b`."""
        pushes = []
        for joint, (row_a, offset_a), (row_b, offset_b), axis in self._struts:
            at_a, speed_a = part_motion(rows[row_a], offset_a)
            at_b, speed_b = part_motion(rows[row_b], offset_b)
            x, y, z, w = rows[row_a][3:7]
            along = rotate_vector((x, y, z, w), axis)
            position = dot(subtract(at_b, at_a), along)
            rate = dot(subtract(speed_b, speed_a), along)
            size = -joint.drive.stiffness * position - joint.drive.damping * rate
            pushes += opposite_forces(joint.b, at_b, joint.a, at_b, scale(along, size))
        return pushes
