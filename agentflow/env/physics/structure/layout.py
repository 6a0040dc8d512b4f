"""Assignment of rows to rigid clusters and moving objects; `physics.rows` defines a row."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from agentflow.env.physics.frames import swap
from agentflow.env.physics.laws.forces import PartLocations
from agentflow.env.physics.model import Assembly, Joint, Part
from agentflow.env.physics.structure.spanning_tree import Skeleton
from agentflow.env.rollout import Array
from agentflow.env.scene import SceneObject
from agentflow.machine.geometry.vectors import cross, length, subtract

NO_ARM = 1e-9
"""m; positions at rest are exact except for rounding."""


@dataclass(frozen=True)
class RowLayout:
    """The rows of one skeleton: its clusters, piece by piece, then the moving objects, by name."""

    locations: PartLocations
    leading: tuple[int, ...]
    """Leading part of each cluster's row; those of a piece begin with its root."""
    objects: tuple[str, ...]
    object_arms: Array
    """(M, 3) from the centre of mass of each, where its row is, to its centre; engine frame, m."""

    @property
    def object_rows(self) -> slice:
        """Rows of the moving objects."""
        return slice(len(self.leading), len(self.leading) + len(self.objects))

    @property
    def all_locations(self) -> PartLocations:
        """Of parts, then of moving objects."""
        rows = np.arange(self.object_rows.start, self.object_rows.stop, dtype=np.intp)
        return PartLocations(
            np.concatenate([self.locations.row, rows]),
            np.concatenate([self.locations.offset, self.object_arms]),
        )


def lay_out(assembly: Assembly, plan: Skeleton, moving: Sequence[SceneObject]) -> RowLayout:
    """Assign a row to every cluster and every moving object."""
    row_of: dict[int, int] = {}
    leading: list[int] = []
    for piece in plan.pieces:
        for part in piece.parts:
            if plan.cluster[part] not in row_of:
                row_of[plan.cluster[part]] = len(leading)
                leading.append(part)
    rows = [row_of[cluster] for cluster in plan.cluster]
    centres = [part.centre for part in assembly.parts]
    offsets = [
        swap(subtract(centre, centres[leading[row]]))
        for centre, row in zip(centres, rows, strict=True)
    ]
    return RowLayout(
        PartLocations(np.array(rows, dtype=np.intp), np.array(offsets).reshape(-1, 3)),
        tuple(leading),
        tuple(item.name for item in moving),
        0.0 - np.array([swap(item.balance) for item in moving]).reshape(-1, 3),
    )


def drag_locations(assembly: Assembly, plan: Skeleton, locations: PartLocations) -> PartLocations:
    """Where the drag of each part acts: on fewer clusters than there are, to save time.

    A wheel without angular drag turns about its own centre, so all its drag acts at a point of its
    axle. That point belongs to the cluster that holds the axle as well, and drag on that cluster
    gives the same motion.
    """
    row, offset = locations.row.copy(), locations.offset.copy()
    parts = assembly.parts
    for link in plan.links:
        part, parent = parts[link.part], link.parent
        if not part.angular_drag and _on_axle(assembly.joints[link.joint], part):
            row[link.part] = locations.row[parent]
            arm = swap(subtract(part.centre, parts[parent].centre))
            offset[link.part] = locations.offset[parent] + arm
    return PartLocations(row, offset)


def _on_axle(joint: Joint, part: Part) -> bool:
    """Whether the part's centre stays where it is while the joint turns."""
    arm = subtract(part.centre, joint.pivot)
    if joint.kind == "revolute":
        arm = cross(arm, joint.axis)
    return joint.kind in ("revolute", "spherical") and length(arm) < NO_ARM
