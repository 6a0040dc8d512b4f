"""Spanning trees of joints: which joints carry the machine and which close loops.

Rigid joints are taken first, so a moving joint that rigid ones bridge is locked, as it would be in
the real machine. Several moving joints may connect the same two rigid clusters. If they allow a
common motion that is also the whole freedom of one of them (hinges with one axis, say), that one
is in the tree and the others are parallel to it; if they allow none, they lock each other.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from agentflow.env.physics.model import Joint
from agentflow.machine.geometry.vectors import cross, dot, length, scale, subtract

APART = 1e-6
"""m, and sine of an angle: pivots and axes at rest are exact except for rounding."""


@dataclass(frozen=True)
class Parallel:
    """A joint that always moves as another one does, which stands for it in the simulation."""

    joint: int
    sign: float
    """Its position over that of the other joint: 1 or -1. Balls have no position: 1."""


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
    parallel: tuple[Parallel, ...] = ()
    """Joints parallel to that joint."""
    rigid: bool = False
    """Whether that joint cannot move, although it is of a moving kind."""


@dataclass(frozen=True)
class Piece:
    """One connected component: a root and its links, parents before children."""

    root: int
    links: tuple[Link, ...]
    loops: tuple[Link, ...] = ()
    """Moving joints that close a loop between clusters and are parallel to no other joint; as if
    their part `b` hung on `a`."""

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
    """Moving joints that rigid ones bridge."""
    jammed: tuple[int, ...]
    """Moving joints that others hold, whose freedom has nothing in common with theirs; those in the
    tree are rigid links."""
    redundant: tuple[int, ...]
    """Rigid joints that close a loop within a cluster and share its load."""

    @property
    def links(self) -> Iterator[Link]:
        """The links of all pieces."""
        return (link for piece in self.pieces for link in piece.links)

    @property
    def loops(self) -> tuple[Link, ...]:
        """The loops of all pieces."""
        return tuple(loop for piece in self.pieces for loop in piece.loops)

    @property
    def parallel(self) -> Iterator[Parallel]:
        """All joints that are parallel to another one."""
        return (other for link in (*self.links, *self.loops) for other in link.parallel)


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
        joints: All joints; earlier ones are preferred among those of equal `preference`.
        broken: Indices of joints that broke or were released.
    """
    sets = _Sets(count)
    whole = [i for i in range(len(joints)) if i not in broken]
    used: list[int] = []
    redundant: list[int] = []
    loops: list[int] = []
    for i in (i for i in whole if joints[i].kind == "fixed"):
        (used if sets.join(joints[i].a, joints[i].b) else redundant).append(i)
    moving = [i for i in whole if joints[i].kind != "fixed"]
    moving.sort(key=lambda i: preference(joints[i]))
    locked = [i for i in moving if sets.find(joints[i].a) == sets.find(joints[i].b)]
    rigid = _lock(joints, moving, sets)
    cluster = tuple(sets.find(part) for part in range(count))
    jammed = {i for i in moving if cluster[joints[i].a] == cluster[joints[i].b]} - set(locked)
    leading = _leading(joints, moving, cluster)
    for i in leading:
        (used if sets.join(joints[i].a, joints[i].b) else loops).append(i)
    return Skeleton(
        _pieces(count, joints, sorted((*used, *rigid)), sorted(loops), leading, rigid),
        cluster,
        tuple(sorted(locked)),
        tuple(sorted(jammed)),
        tuple(redundant),
    )


def preference(joint: Joint) -> tuple[bool, bool]:
    """Moving joints with the least are taken into trees first: balls last, motors before others."""
    return joint.kind == "spherical", joint.drive.torque == 0.0


def _between(
    joints: Sequence[Joint], moving: Sequence[int], cluster: Callable[[int], int]
) -> dict[tuple[int, int], list[int]]:
    """The moving joints between each two clusters."""
    pairs: dict[tuple[int, int], list[int]] = {}
    for i in moving:
        a, b = cluster(joints[i].a), cluster(joints[i].b)
        if a != b:
            pairs.setdefault((min(a, b), max(a, b)), []).append(i)
    return pairs


def _lock(joints: Sequence[Joint], moving: Sequence[int], sets: _Sets) -> list[int]:
    """Unite all clusters whose joints lock each other; returns the joint that unites each two."""
    rigid: list[int] = []
    while True:
        for group in _between(joints, moving, sets.find).values():
            if len(group) > 1 and not _can_move([joints[i] for i in group]):
                sets.join(joints[group[0]].a, joints[group[0]].b)
                rigid.append(group[0])
                break
        else:
            return rigid


def _can_move(group: Sequence[Joint]) -> bool:
    """Whether joints between the same two clusters, balls last, allow any common motion."""
    first = group[0]
    if first.kind == "spherical":
        lines = (subtract(joint.pivot, first.pivot) for joint in group)
        line = next((line for line in lines if length(line) > APART), None)
        if line is None:
            return True
        first = replace(first, kind="revolute", axis=scale(line, 1.0 / length(line)))
    return all(_allows(joint, first) for joint in group)


def _allows(joint: Joint, other: Joint) -> bool:
    """Whether a joint between the same two clusters allows all the motion of another."""
    arm = subtract(joint.pivot, other.pivot)
    if joint.kind == "spherical":
        off = cross(arm, other.axis) if other.kind == "revolute" else arm
        return other.kind != "prismatic" and length(off) < APART
    in_line = joint.kind == "prismatic" or length(cross(arm, other.axis)) < APART
    return joint.kind == other.kind and in_line and length(cross(joint.axis, other.axis)) < APART


def _leading(
    joints: Sequence[Joint], moving: Sequence[int], cluster: Sequence[int]
) -> dict[int, tuple[Parallel, ...]]:
    """The moving joints that are parallel to none before them, and those parallel to each."""
    leading: dict[int, tuple[Parallel, ...]] = {}
    for group in _between(joints, moving, cluster.__getitem__).values():
        own: dict[int, tuple[Parallel, ...]] = {}
        for i in group:
            first = next((k for k in own if _allows(joints[i], joints[k])), None)
            if first is None:
                own[i] = ()
            else:
                own[first] += (Parallel(i, _sign(joints[i], joints[first], cluster)),)
        leading |= own
    return {i: leading[i] for i in moving if i in leading}


def _sign(joint: Joint, other: Joint, cluster: Sequence[int]) -> float:
    """Sign of a joint's position when that of another one, to which it is parallel, is positive."""
    if joint.kind == "spherical":
        return 1.0
    alike = cluster[joint.a] == cluster[other.a]
    return 1.0 if alike == (dot(joint.axis, other.axis) > 0.0) else -1.0


def _pieces(
    count: int,
    joints: Sequence[Joint],
    used: Sequence[int],
    loops: Sequence[int],
    parallel: Mapping[int, tuple[Parallel, ...]],
    rigid: Collection[int],
) -> tuple[Piece, ...]:
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
                    links.append(Link(other, part, i, flip, parallel.get(i, ()), i in rigid))
        inside = {root, *(link.part for link in links)}
        closing = tuple(
            Link(joints[i].b, joints[i].a, i, False, parallel[i])
            for i in loops
            if joints[i].a in inside
        )
        pieces.append(Piece(root, tuple(links), closing))
    return tuple(pieces)
