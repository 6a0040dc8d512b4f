"""Spanning trees of joints: which joints carry the machine and which close loops.

Rigid joints are taken first, so a moving joint that rigid ones bridge is locked, as it would be in
the real machine. Then moving joints that others hold (`machine.geometry.mobility`) are rigid. One
of several parallel ones is in the tree or closes a loop and represents all.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

from agentflow.env.physics.model import Joint
from agentflow.machine.geometry.mobility import Sets, lock, parallel_joints
from agentflow.machine.geometry.vectors import dot


@dataclass(frozen=True)
class Parallel:
    """A joint that always moves as another one does, which stands for it in the simulation.

    `sign` is its position over that of the other joint: 1 or -1. Balls have no position: 1.
    """

    joint: int
    sign: float


@dataclass(frozen=True)
class Link:
    """A part and the joint that connects it to its parent, another part, in the tree."""

    part: int
    parent: int
    joint: int
    reversed: bool
    """Whether the part is the joint's `a`, which reverses the sign of joint positions."""
    parallel: tuple[Parallel, ...] = ()
    """Joints parallel to that joint."""
    rigid: bool = False
    """Whether that joint cannot move, although it is of a moving kind."""

    @property
    def joints(self) -> tuple[tuple[int, float], ...]:
        """That joint and those parallel to it, with the signs of their positions over its own."""
        return (self.joint, 1.0), *((other.joint, other.sign) for other in self.parallel)


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


_last: tuple[object, Skeleton] = (), Skeleton((), (), (), (), ())
"""The skeleton that was asked for last: a world asks for it, then its loads do, or vice versa."""


def skeleton(count: int, joints: Sequence[Joint], broken: Collection[int] = ()) -> Skeleton:
    """Spanning trees over the parts, from the joints that are not broken.

    Args:
        count: Number of parts.
        joints: All joints; earlier ones are preferred among those of equal `preference`.
        broken: Indices of joints that broke or were released.
    """
    global _last
    of = count, tuple(joints), frozenset(broken)
    known = _last
    if known[0] != of:
        known = _last = of, _grow(*of)
    return known[1]


def _grow(count: int, joints: Sequence[Joint], broken: Collection[int]) -> Skeleton:
    sets = Sets()
    whole = [i for i in range(len(joints)) if i not in broken]
    used: list[int] = []
    redundant: list[int] = []
    loops: list[int] = []
    for i in (i for i in whole if joints[i].kind == "fixed"):
        (used if sets.join(joints[i].a, joints[i].b) else redundant).append(i)
    moving = [i for i in whole if joints[i].kind != "fixed"]
    moving.sort(key=lambda i: preference(joints[i]))
    locked = [i for i in moving if sets.find(joints[i].a) == sets.find(joints[i].b)]
    rigid = lock(joints, moving, sets)
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


def _leading(
    joints: Sequence[Joint], moving: Sequence[int], cluster: Sequence[int]
) -> dict[int, tuple[Parallel, ...]]:
    """The moving joints that are parallel to none before them, and those parallel to each."""
    return {
        lead: tuple(Parallel(i, _sign(joints[i], joints[lead], cluster)) for i in others)
        for lead, others in parallel_joints(joints, moving, cluster.__getitem__).items()
    }


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
