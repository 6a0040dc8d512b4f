"""Which row of a table belongs to which rigid cluster, and where each part sits in its cluster.

An engine reads one row per rigid cluster and per moving thing; `physics.rows` defines a row.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from agentflow.env.physics.frames import swap
from agentflow.env.physics.laws.forces import PartLocations
from agentflow.env.physics.model import Assembly, Joint, Part
from agentflow.env.physics.spanning_tree import Piece, Skeleton
from agentflow.env.rollout import Array
from agentflow.env.scene import Thing
from agentflow.machine.geometry.vectors import cross, length, subtract

NO_ARM = 1e-9
"""m; places at rest are exact but for rounding."""

Handle = tuple[int, int]
"""Body and link, as the engine numbers them; link -1 is the base."""


@dataclass(frozen=True)
class Built:
    """A piece of the machine as a body in an engine's world."""

    uid: int
    """Body number in the engine."""
    piece: Piece
    index: Mapping[int, int]
    """Part -> link number in the engine; -1 is the base."""


@dataclass(frozen=True)
class RowLayout:
    """The rows of one skeleton: clusters in the order of their bodies, then the moving things."""

    locations: PartLocations
    handles: tuple[Handle, ...]
    """Body and link whose motion each row holds."""
    leading: tuple[int, ...]
    """Leading part of each cluster's row."""
    things: tuple[str, ...]
    """Names of the moving things; their rows come last."""
    thing_arms: Array
    """(M, 3) from the centre of mass of each, where its row is, to its centre; engine frame, m."""
    bodies: tuple[tuple[int, tuple[int, ...]], ...]
    """Number of each body, and those of its links that lead clusters, in row order."""

    @property
    def thing_rows(self) -> slice:
        """Rows of the moving things."""
        return slice(len(self.leading), len(self.handles))


def lay_out(
    assembly: Assembly,
    plan: Skeleton,
    built: Sequence[Built],
    moving: Sequence[Thing],
    numbers: Mapping[str, int],
) -> RowLayout:
    """Assign a row to every cluster and every moving thing.

    Args:
        assembly: The machine.
        plan: Its current skeleton.
        built: The bodies, in the skeleton's order.
        moving: Things that can move.
        numbers: Body number of each thing.
    """
    row_of: dict[int, int] = {}
    leading: list[int] = []
    handles: list[Handle] = []
    bodies = []
    for body in built:
        links = []
        for part, index in body.index.items():
            if plan.cluster[part] not in row_of:
                row_of[plan.cluster[part]] = len(handles)
                leading.append(part)
                handles.append((body.uid, index))
                links += [index] if index >= 0 else []
        bodies.append((body.uid, tuple(links)))
    rows = [row_of[cluster] for cluster in plan.cluster]
    centres = [part.centre for part in assembly.parts]
    offsets = [
        swap(subtract(centre, centres[leading[row]]))
        for centre, row in zip(centres, rows, strict=True)
    ]
    handles += [(numbers[thing.name], -1) for thing in moving]
    return RowLayout(
        PartLocations(np.array(rows, dtype=np.intp), np.array(offsets).reshape(-1, 3)),
        tuple(handles),
        tuple(leading),
        tuple(thing.name for thing in moving),
        0.0 - np.array([swap(thing.balance) for thing in moving]).reshape(-1, 3),
        tuple(bodies),
    )


def drag_locations(assembly: Assembly, plan: Skeleton, locations: PartLocations) -> PartLocations:
    """`locations` as drag may see them, which then acts on fewer clusters.

    A wheel turns about its own centre, so if turning itself meets no drag, the wheel's drag acts
    at a point of its axle. The cluster that holds the axle contains that point as well; assigning
    the wheel's drag to that cluster gives the same motion.
    """
    row, offset = locations.row.copy(), locations.offset.copy()
    parts = assembly.parts
    for link in (link for body in plan.pieces for link in body.links):
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
