"""Which moving joints cannot move because others hold the same parts, and which act as one.

Several joints between the same two clusters jam unless they allow a common motion that is the whole
freedom of one of them (hinges with one axis, say); the others are then parallel to that one. In
longer loops, a joint jams if no motion of the loop uses it: the three hinges of a triangle, say.
A jammed joint makes one cluster of the two that it connects.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence

from agentflow.machine.geometry.joints import Loop, MovingJoint
from agentflow.machine.geometry.vectors import cross, length, scale, subtract


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


APART = 1e-6
"""m, and sine of an angle: pivots and axes at rest are exact except for rounding."""
JAMMED = "other moving joints hold the same parts"


def lock(joints: Sequence[MovingJoint], moving: Sequence[int], sets: Sets) -> list[int]:
    """Unite the clusters of all jammed joints; returns a joint for each union.

    Args:
        joints: All joints.
        moving: Indices of the moving ones to look at.
        sets: The clusters without them.
    """
    rigid: list[int] = []
    while held := _held_in_pairs(joints, moving, sets) or _held_in_loops(joints, moving, sets):
        rigid += [i for i in held if sets.join(joints[i].a, joints[i].b)]
    return rigid


def parallel_joints(
    joints: Sequence[MovingJoint], moving: Sequence[int], cluster: Callable[[int], int]
) -> dict[int, list[int]]:
    """The joints between different clusters that are parallel to none before them, with those
    parallel to each."""
    found: dict[int, list[int]] = {}
    for group in _between(joints, moving, cluster).values():
        own: dict[int, list[int]] = {}
        for i in group:
            first = next((k for k in own if _allows(joints[i], joints[k])), None)
            if first is None:
                own[i] = []
            else:
                own[first].append(i)
        found |= own
    return {i: found[i] for i in moving if i in found}


def find_loops(
    joints: Sequence[MovingJoint], moving: Sequence[int], cluster: Callable[[int], int]
) -> Iterator[Loop]:
    """Independent loops of which all others consist."""
    tree = Sets()
    closing: list[tuple[int, int, int]] = []
    near: dict[int, list[tuple[int, int, float]]] = {}
    for i in moving:
        a, b = cluster(joints[i].a), cluster(joints[i].b)
        if not tree.join(a, b):
            closing.append((i, a, b))
            continue
        near.setdefault(a, []).append((b, i, 1.0))
        near.setdefault(b, []).append((a, i, -1.0))
    for i, start, end in closing:
        yield [(i, 1.0), *_way(near, end, start)]


def _between(
    joints: Sequence[MovingJoint], moving: Sequence[int], cluster: Callable[[int], int]
) -> dict[tuple[int, int], list[int]]:
    """The moving joints between each two clusters."""
    pairs: dict[tuple[int, int], list[int]] = {}
    for i in moving:
        a, b = cluster(joints[i].a), cluster(joints[i].b)
        if a != b:
            pairs.setdefault((min(a, b), max(a, b)), []).append(i)
    return pairs


def _held_in_pairs(joints: Sequence[MovingJoint], moving: Sequence[int], sets: Sets) -> list[int]:
    """One joint of each group of joints between the same two clusters that hold each other."""
    return [
        group[0]
        for group in _between(joints, moving, sets.find).values()
        if len(group) > 1 and not _can_move([joints[i] for i in group])
    ]


def _can_move(group: Sequence[MovingJoint]) -> bool:
    """Whether joints between the same two clusters allow any common motion."""
    first = next((joint for joint in group if joint.kind != "spherical"), None)
    if first is not None:
        return all(_allows(joint, first) for joint in group)
    arms = [subtract(joint.pivot, group[0].pivot) for joint in group]
    line = max(arms, key=length)
    if length(line) < APART:
        return True
    line = scale(line, 1.0 / length(line))
    return all(length(cross(arm, line)) < APART for arm in arms)


def _allows(joint: MovingJoint, other: MovingJoint) -> bool:
    """Whether a joint between the same two clusters allows all the motion of another."""
    arm = subtract(joint.pivot, other.pivot)
    if joint.kind == "spherical":
        off = cross(arm, other.axis) if other.kind == "revolute" else arm
        return other.kind != "prismatic" and length(off) < APART
    in_line = joint.kind == "prismatic" or length(cross(arm, other.axis)) < APART
    return joint.kind == other.kind and in_line and length(cross(joint.axis, other.axis)) < APART


def _held_in_loops(joints: Sequence[MovingJoint], moving: Sequence[int], sets: Sets) -> list[int]:
    """The joints that no motion of their loops uses."""
    loops = list(find_loops(joints, sorted(parallel_joints(joints, moving, sets.find)), sets.find))
    if not loops:
        return []
    from agentflow.machine.geometry.linkages import used_joints  # numpy, which few machines need

    return [
        i
        for group in _linked(loops)
        for i in sorted({i for loop in group for i, _ in loop} - used_joints(joints, group))
    ]


def _way(near: Mapping[int, Sequence[tuple[int, int, float]]], start: int, end: int) -> Loop:
    """The joints from one cluster of a tree to another."""
    ways: dict[int, list[tuple[int, float]]] = {start: []}
    queue = [start]
    for here in queue:
        for there, i, sign in near[here]:
            if there not in ways:
                ways[there] = [*ways[here], (i, sign)]
                queue.append(there)
    return ways[end]


def _linked(loops: Sequence[Loop]) -> list[list[Loop]]:
    """The loops, those that share joints together."""
    sets = Sets()
    for loop in loops:
        for i, _ in loop:
            sets.join(i, loop[0][0])
    groups: dict[int, list[Loop]] = {}
    for loop in loops:
        groups.setdefault(sets.find(loop[0][0]), []).append(loop)
    return list(groups.values())
