"""What is connected with what: bonds between the ends of blocks, and the pieces that they form."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from agentflow.machine.blocks.library import library
from agentflow.machine.geometry.placement import Geometry

End = tuple[int, int]
"""Block and end: 0 is the end at its parent, 1 the second end of a two-ended block."""
Bond = tuple[End, End]


class Groups:
    """Disjoint sets of connected ends."""

    def __init__(self) -> None:
        self._up: dict[End, End] = {}

    def find(self, end: End) -> End:
        """The end that names the group."""
        while (above := self._up.get(end, end)) != end:
            end = above
        return end

    def join(self, bond: Bond) -> None:
        """Unite the groups of two ends."""
        one, other = self.find(bond[0]), self.find(bond[1])
        self._up[max(one, other)] = min(one, other)

    def connected(self, bond: Bond) -> bool:
        """Whether two ends are in one group."""
        return self.find(bond[0]) == self.find(bond[1])


def extra_bonds(geometry: Geometry) -> Iterator[tuple[Bond, int]]:
    """Rigid connections other than to parents, each with the block that makes it (last)."""
    for placed in geometry.blocks:
        if placed.two_ended:
            yield ((placed.step.parents[1], 0), (placed.id, 1)), placed.id
            if library()[placed.type].connector == "rod":
                yield ((placed.id, 0), (placed.id, 1)), placed.id
    for link in geometry.auto_connections:
        yield ((link.partner, 0), (link.block, 0)), link.block


def largest_piece(geometry: Geometry) -> int:
    """Number of parts (`BlockType.parts`) of the piece that has most, before anything breaks."""
    groups, parts = Groups(), Counter[End]()
    for placed in geometry.blocks:
        if placed.step.parent >= 0 and library()[placed.type].joint.kind != "loose":
            groups.join(((placed.step.parent, 0), (placed.id, 0)))
    for bond, _ in extra_bonds(geometry):
        groups.join(bond)
    for placed in geometry.blocks:
        if placed.two_ended:
            parts.update(groups.find((placed.id, end)) for end in (0, 1))
        else:
            parts[groups.find((placed.id, 0))] += library()[placed.type].parts
    return max(parts.values())
