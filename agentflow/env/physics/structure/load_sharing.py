"""Load sharing among rigid connections that form loops.

Engines measure reactions in spanning trees, in which connections that close loops carry nothing.
The real loads are statically indeterminate: here parts are rigid and connections elastic, each as
stiff as the square of its strength, so the loads are those of least strain energy (least sum of
squared load over strength). They are linear in the reactions of the tree, by a matrix computed once
per spanning tree. What a motor exerts along the free axis of its joint is not a load on that joint.

All arithmetic is elementwise in a fixed order, without BLAS, so the bits do not depend on the
processor. Axes are in the order x, z, y of a right-handed frame; another order of summation would
change the last digits of recorded loads.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from agentflow.env.physics.frames import WRENCH_ORDER, WRENCH_SIGNS, swap
from agentflow.env.physics.model import Joint, Strength
from agentflow.env.physics.structure.spanning_tree import Link, Skeleton
from agentflow.env.rollout import Array, Indices
from agentflow.machine.geometry.vectors import subtract

RIGID = Strength(1e8, 1e8)
"""Of connections that never break: they are far stiffer than all others."""
SOFT = 0.05
"""Flexibility along a free axis times what the drive exerts (N m, or N/m of a spring). With it, the
strongest motor of 2,825 N m is a thousand times as flexible as a connection of 7,500 N m."""
IDLE = 1e-3
"""N m, stands for the drive of a joint that has none."""


@dataclass(frozen=True)
class LoadLoop:
    """Connections that share load with each other and with no others: K, of which first T in the
    tree, then those that close loops."""

    joints: Indices
    sources: Indices
    """(6 T,) indices of the reactions at the tree's T connections, in the flattened reactions."""
    matrix: Array
    """(6 T, 6 K) contribution of each of those reactions to the load on each connection."""

    def share(self, reactions: Array) -> Array:
        """(K, 6) loads on the connections, from the (J, 6) reactions of the tree."""
        terms = self.matrix * reactions.ravel()[self.sources][:, None]
        return np.asarray(np.add.reduce(terms, axis=0)).reshape(-1, 6)


def load_loops(joints: Sequence[Joint], plan: Skeleton) -> tuple[LoadLoop, ...]:
    """The load loops of a machine, in the order of their first closing joint.

    Args:
        joints: All joints.
        plan: The spanning trees for which reactions are measured.
    """
    up = {link.part: link for link in plan.links}
    inside = {*plan.redundant, *plan.locked, *plan.jammed} - {link.joint for link in plan.links}
    found = {i: _path(joints[i], up) for i in inside}
    for link in plan.links:
        found |= {other.joint: _path(joints[other.joint], up) for other in link.parallel}
    for loop in plan.loops:
        found |= {
            other.joint: _path_over(joints, other.joint, loop.joint, plan.cluster, up)
            for other in loop.parallel
        }
    paths = dict(sorted(found.items()))
    groups: list[list[int]] = []
    for closing, path in paths.items():
        merged = [closing]
        for group in [group for group in groups if any(paths[i].keys() & path for i in group)]:
            groups.remove(group)
            merged = group + merged
        groups.append(merged)
    return tuple(
        _load_loop(joints, [paths[i] for i in group], group, inside)
        for group in sorted(sorted(group) for group in groups)
    )


def _path(closing: Joint, up: Mapping[int, Link]) -> dict[int, float]:
    """Tree joints between the ends of a closing joint, each with the sign with which the closing
    joint's load relieves it."""
    ways = []
    for part, sign in ((closing.b, 1.0), (closing.a, -1.0)):
        way = {}
        while part in up:
            link = up[part]
            way[link.joint] = -sign if link.reversed else sign
            part = link.parent
        ways.append(way)
    first, second = ways
    return {
        joint: sign
        for joint, sign in (first | second).items()
        if (joint in first) != (joint in second)
    }


def _path_over(
    joints: Sequence[Joint],
    closing: int,
    loop: int,
    cluster: Sequence[int],
    up: Mapping[int, Link],
) -> dict[int, float]:
    """The same for a joint parallel to one that closes a loop: it relieves that joint, and those of
    the tree that lie between the two."""
    alike = cluster[joints[closing].a] == cluster[joints[loop].a]
    sign = 1.0 if alike else -1.0
    change = dict(_path(joints[closing], up))
    for joint, way in _path(joints[loop], up).items():
        change[joint] = change.get(joint, 0.0) - sign * way
    return {joint: way for joint, way in change.items() if way} | {loop: sign}


def _load_loop(
    joints: Sequence[Joint],
    paths: Sequence[Mapping[int, float]],
    closing: Sequence[int],
    inside: Collection[int],
) -> LoadLoop:
    """Solve for the loads on the closing joints and those left on the tree.

    Minimises (r - C x)^T F (r - C x) + x^T F x, with the reactions r of the tree, the loads x on
    the closing joints, their transfer C to the joints of the tree, and the flexibility F. Joints
    `inside` a rigid cluster bear nothing along their free axes.
    """
    carrying = sorted({joint for path in paths for joint in path})
    transfer = _transfer(joints, paths, closing, carrying)
    flexible = np.concatenate([_flexibility(joints[i]) for i in carrying])
    bears = [
        np.logical_not(_is_free(joints[i])) if i in inside else np.ones(6, dtype=bool)
        for i in closing
    ]
    kept = np.flatnonzero(np.concatenate(bears))
    transfer = transfer[:, kept]
    weighted = np.ascontiguousarray((flexible[:, None] * transfer).T)
    system = product(weighted, transfer)
    own = np.concatenate([_flexibility(joints[i]) for i in closing])[kept]
    system[np.arange(len(kept)), np.arange(len(kept))] += own
    solved = solve(system, weighted)
    count = len(carrying)
    matrix = np.zeros((6 * (count + len(closing)), 6 * count))
    matrix[: 6 * count] = np.eye(6 * count) - product(transfer, solved)
    matrix[6 * count + kept] = solved
    matrix[np.concatenate([_is_free(joints[i]) for i in (*carrying, *closing)])] = 0.0
    sources = 6 * np.repeat(carrying, 6) + np.tile(WRENCH_ORDER, count)
    columns = 6 * np.repeat(np.arange(count + len(closing)), 6) + np.tile(
        WRENCH_ORDER, count + len(closing)
    )
    signs = np.tile(WRENCH_SIGNS, count)[:, None] * np.tile(WRENCH_SIGNS, count + len(closing))
    return LoadLoop(
        np.array([*carrying, *closing], dtype=np.intp),
        sources.astype(np.intp),
        np.ascontiguousarray((matrix.T * signs)[:, columns]),
    )


def _transfer(
    joints: Sequence[Joint],
    paths: Sequence[Mapping[int, float]],
    closing: Sequence[int],
    carrying: Sequence[int],
) -> Array:
    """(6 T, 6 I) relief of each joint of the tree by a unit load on each closing joint."""
    row = {joint: 6 * k for k, joint in enumerate(carrying)}
    whole = np.zeros((6 * len(carrying), 6 * len(closing)))
    for k, (i, path) in enumerate(zip(closing, paths, strict=True)):
        for joint, sign in path.items():
            x, y, z = swap(subtract(joints[i].pivot, joints[joint].pivot))
            block = np.eye(6)
            block[3:, :3] = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]
            whole[row[joint] : row[joint] + 6, 6 * k : 6 * k + 6] = sign * block
    return whole


def _flexibility(joint: Joint) -> Array:
    """(6,) displacement under unit load, in arbitrary units.

    Along its free axes a joint yields in inverse proportion to what its drive exerts, so parallel
    joints share the torque of their motors as they produce it.
    """
    strength, drive = joint.strength or RIGID, joint.drive
    stiff = np.repeat([1.0 / strength.force**2, 1.0 / strength.torque**2], 3)
    capacity = drive.stiffness or drive.torque or drive.friction
    return np.where(_is_free(joint), SOFT / max(capacity, IDLE), stiff)


def _is_free(joint: Joint) -> Array:
    """(6,) along which forces and torques a joint is free to move."""
    along = np.abs(swap(joint.axis)) > 0.5
    mask = np.zeros(6, dtype=bool)
    if joint.kind == "prismatic":
        mask[:3] = along
    elif joint.kind == "revolute":
        mask[3:] = along
    elif joint.kind == "spherical":
        mask[3:] = True
    return mask


def product(a: Array, b: Array) -> Array:
    """Matrix product, summed term by term in order."""
    result = np.zeros((a.shape[0], b.shape[1]))
    for k in range(a.shape[1]):
        result += a[:, k, None] * b[k]
    return result


def solve(system: Array, right: Array) -> Array:
    """Solve a symmetric positive definite system by Gauss-Jordan elimination without pivoting."""
    count = len(system)
    table = np.concatenate([system, right], axis=1)
    for k in range(count):
        table[k] /= table[k, k]
        factors = table[:, k].copy()
        factors[k] = 0.0
        table -= factors[:, None] * table[k]
    return table[:, count:]
