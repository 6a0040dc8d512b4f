"""Spanning trees of joints: which joints carry the machine and which close loops.

Rigid joints are taken first, so a moving joint that rigid ones bridge is locked, as it would be in
the real machine.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass

from agentflow.env.physics.model import Joint


@dataclass(frozen=True)
class Link:
    """A part and the joint that connects it to its parent in the tree."""

    part: int
    parent: int
    """Part index of the parent."""
    joint: int
    """Index of that joint."""
    reversed: bool
    """Whether the part is the joint's `a`, which reverses the sign of joint positions."""


@dataclass(frozen=True)
class Piece:
    """One connected component: a root and its links, parents before children."""

    root: int
    links: tuple[Link, ...]

    @property
    def parts(self) -> tuple[int, ...]:
        """The root, then the part of each link."""
        return (self.root, *(link.part for link in self.links))


@dataclass(frozen=True)
class Skeleton:
    """How the parts are connected."""

    pieces: tuple[Piece, ...]
    """In order of their roots; each root is the lowest part index of its piece."""
    cluster: tuple[int, ...]
    """Rigid cluster of each part, named by its lowest part index."""
    locked: tuple[int, ...]
    """Moving joints inside one rigid cluster."""
    loops: tuple[int, ...]
    """Moving joints that close a loop between clusters."""
    redundant: tuple[int, ...]
    """Rigid joints that close a loop within a cluster and share its load."""

    @property
    def links(self) -> Iterator[Link]:
        """The links of all pieces."""
        return (link for piece in self.pieces for link in piece.links)


class _Sets:
    """Disjoint sets of parts, each named by its lowest member."""

    def __init__(self, count: int) -> None:
        self._up = list(range(count))

    def find(self, part: int) -> int:
        while self._up[part] != part:
            self._up[part] = self._up[self._up[part]]
            part = self._up[part]
        return part

    def join(self, a: int, b: int) -> bool:
        """Unite two sets; False if they already were one."""
        a, b = self.find(a), self.find(b)
        if a == b:
            return False
        self._up[max(a, b)] = min(a, b)
        return True


def skeleton(count: int, joints: Sequence[Joint], broken: Collection[int] = ()) -> Skeleton:
    """Spanning trees over the parts, from the joints that are not broken.

    Args:
        count: Number of parts.
        joints: All joints; earlier ones are preferred, and motors are preferred to other joints.
        broken: Indices of joints that broke or were released.
    """
    sets = _Sets(count)
    whole = [i for i in range(len(joints)) if i not in broken]
    used: list[int] = []
    redundant: list[int] = []
    locked: list[int] = []
    loops: list[int] = []
    for i in (i for i in whole if joints[i].kind == "fixed"):
        (used if sets.join(joints[i].a, joints[i].b) else redundant).append(i)
    cluster = tuple(sets.find(part) for part in range(count))
    moving = [i for i in whole if joints[i].kind != "fixed"]
    for i in sorted(moving, key=lambda i: joints[i].drive.torque == 0.0):
        if cluster[joints[i].a] == cluster[joints[i].b]:
            locked.append(i)
        else:
            (used if sets.join(joints[i].a, joints[i].b) else loops).append(i)
    return Skeleton(
        _pieces(count, joints, sorted(used)),
        cluster,
        tuple(sorted(locked)),
        tuple(sorted(loops)),
        tuple(redundant),
    )


def _pieces(count: int, joints: Sequence[Joint], used: Sequence[int]) -> tuple[Piece, ...]:
    near: list[list[int]] = [[] for _ in range(count)]
    for i in used:
        near[joints[i].a].append(i)
        near[joints[i].b].append(i)
    pieces, seen = [], [False] * count
    for root in range(count):
        if seen[root]:
            continue
        seen[root] = True
        links: list[Link] = []
        queue = [root]
        for part in queue:
            for i in near[part]:
                flip = joints[i].b == part
                other = joints[i].a if flip else joints[i].b
                if not seen[other]:
                    seen[other] = True
                    queue.append(other)
                    links.append(Link(other, part, i, flip))
        pieces.append(Piece(root, tuple(links)))
    return tuple(pieces)
