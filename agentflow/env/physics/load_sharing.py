"""How connections that close loops inside rigid clusters share the load.

Engines measure spanning trees, in which such connections carry nothing. Here parts are rigid and
connections elastic, each as stiff as the square of its strength: of all ways to hold the same
loads, the elastic one strains the connections least (least sum of squared load over strength).
What they bear is linear in the reactions of the tree, by a matrix made once per spanning tree.

All arithmetic is elementwise in a fixed order, without BLAS, so the bits do not depend on the
processor. The order of the axes is x, z, y, in a right-handed frame: sums in another order would
change the last digits of recorded loads.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agentflow.env.physics.frames import WRENCH_ORDER, WRENCH_SIGNS, swap
from agentflow.env.physics.model import Joint, Strength
from agentflow.env.physics.spanning_tree import Link, Skeleton
from agentflow.env.rollout import Array
from agentflow.machine.geometry.vectors import subtract

Indices = NDArray[np.intp]
RIGID = Strength(1e8, 1e8)
"""Of connections that never break: next to them everything else gives way."""


@dataclass(frozen=True)
class LoadLoop:
    """Connections that share load with each other and with no others."""

    joints: Indices
    """(K,) those in the tree, then those that close loops."""
    sources: Indices
    """(6 T,) where in the flat reactions the numbers are that the tree's T connections bear."""
    matrix: Array
    """(6 T, 6 K): what each of those numbers adds to what each connection bears."""

    def share(self, reactions: Array) -> Array:
        """(K, 6) what each connection bears, from the (J, 6) reactions of the tree."""
        terms = self.matrix * reactions.ravel()[self.sources][:, None]
        return np.asarray(np.add.reduce(terms, axis=0)).reshape(-1, 6)


def load_loops(joints: Sequence[Joint], plan: Skeleton) -> tuple[LoadLoop, ...]:
    """The load loops of a machine, by their first closing joint.

    Args:
        joints: All joints.
        plan: The spanning trees for which reactions are measured.
    """
    up = {link.part: link for link in plan.links}
    paths = {i: _path(joints[i], up) for i in sorted((*plan.idle, *plan.locked))}
    groups: list[list[int]] = []
    for closing, path in paths.items():
        merged = [closing]
        for group in [group for group in groups if any(paths[i].keys() & path for i in group)]:
            groups.remove(group)
            merged = group + merged
        groups.append(merged)
    return tuple(
        _load_loop(joints, [paths[i] for i in group], group)
        for group in sorted(sorted(group) for group in groups)
    )


def _path(closing: Joint, up: Mapping[int, Link]) -> dict[int, float]:
    """Tree joints between the two ends of a closing joint, with the sign by which a unit of what
    the closing joint bears relieves each."""
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


def _load_loop(
    joints: Sequence[Joint], paths: Sequence[Mapping[int, float]], closing: Sequence[int]
) -> LoadLoop:
    """Solve for what the closing joints bear and for what that leaves to the tree.

    Minimises sum over the tree of (r - C x)^T F (r - C x) plus x^T F x, where C carries what the
    closing joints bear, x, to the joints of the tree, and F is the flexibility.
    """
    carrying = sorted({joint for path in paths for joint in path})
    transfer = _transfer(joints, paths, closing, carrying)
    flexible = np.concatenate([_flexibility(joints[i]) for i in carrying])
    held = [np.flatnonzero(_held(joints[i])) + 6 * k for k, i in enumerate(closing)]
    kept = np.concatenate(held)
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
    """(6 T, 6 I): what each joint of the tree is relieved of by what each closing joint bears."""
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
    """(6,) displacement under unit load, in units that do not matter."""
    strength = joint.strength or RIGID
    return np.repeat([1.0 / strength.force**2, 1.0 / strength.torque**2], 3)


def _held(joint: Joint) -> Array:
    """(6,) which forces and torques a joint can bear; a locked one still slides or turns."""
    along = np.abs(swap(joint.axis)) > 0.5
    held = np.ones(6, dtype=bool)
    if joint.kind == "prismatic":
        held[:3] = ~along
    elif joint.kind == "revolute":
        held[3:] = ~along
    elif joint.kind == "spherical":
        held[3:] = False
    return held


def product(a: Array, b: Array) -> Array:
    """Matrix product, summed term by term in order."""
    result = np.zeros((a.shape[0], b.shape[1]))
    for k in range(a.shape[1]):
        result += a[:, k, None] * b[k]
    return result


def solve(system: Array, right: Array) -> Array:
    """The solution of a symmetric positive definite system, by elimination in order."""
    count = len(system)
    table = np.concatenate([system, right], axis=1)
    for k in range(count):
        table[k] /= table[k, k]
        factors = table[:, k].copy()
        factors[k] = 0.0
        table -= factors[:, None] * table[k]
    return table[:, count:]
