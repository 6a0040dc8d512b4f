"""Disjoint sets of numbers."""

from __future__ import annotations


class Sets:
    """Disjoint sets, each named by its lowest member; at first every member is alone."""

    def __init__(self) -> None:
        self._up: dict[int, int] = {}

    def find(self, member: int) -> int:
        """The member that names the set."""
        up = self._up
        while (above := up.get(member, member)) != member:
            up[member] = above = up.get(above, above)
            member = above
        return member

    def join(self, one: int, other: int) -> bool:
        """Unite two sets; False if they already were one."""
        one, other = self.find(one), self.find(other)
        if one == other:
            return False
        self._up[max(one, other)] = min(one, other)
        return True
