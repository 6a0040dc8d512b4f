"""Machines as trees of block types, and the edit distance between them."""

import hashlib
from functools import lru_cache

from agentflow.machine import Machine

CACHED = 2**17
"""Distances kept in memory: all pairs of about 500 different trees."""


def tree_text(machine: Machine) -> str:
    """The machine as a tree of block types in bracket notation, such as "{0{15{2}}{15}}".

    Children are ordered by the face that they are attached to; those that share a face, which only
    two-ended blocks may do, by their own text. A two-ended block is a child of its first parent.
    Block ids do not appear, so machines that differ only in these have equal texts, and machines
    with equal texts have distance 0.
    """
    children: list[list[tuple[int, str]]] = [[] for _ in machine]
    text = ""
    for step in reversed(machine.steps):
        below = "".join(child for _, child in sorted(children[step.id]))
        text = f"{{{step.type}{below}}}"
        if step.parent >= 0:
            children[step.parent].append((step.face_id, text))
    return text


def tree_hash(machine: Machine) -> str:
    """Hash of a machine as a tree of block types: equal where the tree edit distance is 0."""
    return hashlib.sha256(tree_text(machine).encode()).hexdigest()[:16]


def tree_edit_distance(a: Machine, b: Machine) -> float:
    """Fewest blocks to insert, delete or give another type to make one tree the other.

    Each edit costs 1; a deleted block's children take its place among its siblings. The trees are
    those of `tree_text`; positions in space do not count. The algorithm is APTED: M. Pawlik and
    N. Augsten, "Tree edit distance: robust and memory-efficient", Information Systems 56 (2016).
    """
    one, other = sorted((tree_text(a), tree_text(b)))
    return _distance(one, other)


@lru_cache(CACHED)
def _distance(one: str, other: str) -> float:
    from apted import APTED  # an extra
    from apted.helpers import Tree

    if one == other:
        return 0.0
    return float(APTED(Tree.from_text(one), Tree.from_text(other)).compute_edit_distance())
