"""Owns how connections that close loops inside rigid clusters share the load (spec 2.2).

An engine measures spanning trees, in which such connections carry nothing; trees are tree.py's.

Parts are rigid, connections elastic, each as stiff as the square of its strength: of all ways to
hold the same loads, the elastic one strains the connections least (least sum of squared load over
strength). A reaction of the tree is a fixed matrix away from it, made once per spanning tree.
All arithmetic is elementwise in a fixed order, no BLAS: the bits do not depend on the processor.
Axes as engines have them, right-handed with z up.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agentflow.env.physics.frames import swap
from agentflow.env.physics.model import Joint, Strength
from agentflow.env.physics.spanning_tree import Link, Skeleton
from agentflow.env.physics.vectors import subtract
from agentflow.env.rollout import Array

Indices = NDArray[np.intp]
RIGID = Strength(1e8, 1e8)
"""Of connections that never break: next to them everything else gives way."""


@dataclass(frozen=True)
class Ring:
    """Connections that share load with each other and with no others."""

    carrying: Indices
    """(T,) those that the tree consists of."""
    joints: Indices
    """(K,) all of them: `carrying`, then those that close loops."""
    matrix: Array
    """(6 T, 6 K): reactions of the tree to what all bear, times which they are to be summed."""

    def shared(self, reactions: Array) -> Array:
        """(K, 6) what each connection bears, from the (J, 6) reactions of the tree."""
        terms = self.matrix * reactions[self.carrying].reshape(-1, 1)
        return np.asarray(np.add.reduce(terms, axis=0)).reshape(-1, 6)


def rings(joints: Sequence[Joint], plan: Skeleton) -> tuple[Ring, ...]:
    """The rings of a machine, by their first closing joint.

    Args:
        joints: All joints.
        plan: The spanning trees for which reactions are measured.
    """
    up = {link.part: link for body in plan.bodies for link in body.links}
    loops = {i: _loop(joints[i], up) for i in sorted((*plan.idle, *plan.locked))}
    found: list[list[int]] = []
    for closing, loop in loops.items():
        one = [closing]
        for other in [ring for ring in found if any(loops[i].keys() & loop for i in ring)]:
            found.remove(other)
            one = other + one
        found.append(one)
    return tuple(
        _ring(joints, [loops[i] for i in ring], ring)
        for ring in sorted(sorted(ring) for ring in found)
    )


def _loop(closing: Joint, up: Mapping[int, Link]) -> dict[int, float]:
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


def _ring(
    joints: Sequence[Joint], loops: Sequence[Mapping[int, float]], closing: Sequence[int]
) -> Ring:
    """Solve for what the closing joints bear and for what that leaves to the tree.

    Minimises sum over the tree of (r - C x)^T F (r - C x) plus x^T F x, where C carries what the
    closing joints bear, x, to the joints of the tree, and F is the flexibility.
    """
    carrying = sorted({joint for loop in loops for joint in loop})
    transfer = _transfer(joints, loops, closing, carrying)
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
    return Ring(
        np.array(carrying, dtype=np.intp),
        np.array([*carrying, *closing], dtype=np.intp),
        np.ascontiguousarray(matrix.T),
    )


def _transfer(
    joints: Sequence[Joint],
    loops: Sequence[Mapping[int, float]],
    closing: Sequence[int],
    carrying: Sequence[int],
) -> Array:
    """(6 T, 6 I): what each joint of the tree is relieved of by what each closing joint bears."""
    row = {joint: 6 * k for k, joint in enumerate(carrying)}
    whole = np.zeros((6 * len(carrying), 6 * len(closing)))
    for k, (i, loop) in enumerate(zip(closing, loops, strict=True)):
        for joint, sign in loop.items():
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
