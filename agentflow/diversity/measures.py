"""How different the machines of a set are from each other: means over all pairs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from agentflow.diversity.embedding import cosines, embed
from agentflow.diversity.shape import Shape
from agentflow.diversity.solid import Array
from agentflow.diversity.topology import tree_edit_distance
from agentflow.machine import Machine
from agentflow.metrics.intervals import Interval, bootstrap_pairs


class Measure(NamedTuple):
    """The mean of a quantity over all pairs of machines."""

    mean: float | None
    """None for fewer than two machines, which form no pair."""
    interval: Interval | None
    """95 % bootstrap interval over machines; None for fewer than three."""


@dataclass(frozen=True)
class Measures:
    """How different the machines of a set are."""

    machines: int
    chamfer: Measure
    """Diagonals of a machine; see `shape.ShapeDistances` for this and the next two."""
    hausdorff: Measure
    iou: Measure
    """0 to 1."""
    graph_similarity: Measure
    """Cosine, -1 to 1; see `embedding.embed`."""
    tree_edit_distance: Measure
    """Blocks; see `topology.tree_edit_distance`."""


def diversity(machines: Sequence[Machine], seed: int) -> Measures:
    """The measures of one set of machines; see `compare`."""
    return compare([machines], seed)[0]


def compare(sets: Sequence[Sequence[Machine]], seed: int) -> list[Measures]:
    """The measures of several sets of machines. Their graphs are embedded together.

    Args:
        sets: Machines by set; their order and the ids of their blocks do not matter.
        seed: Of the embedding and of the intervals.
    """
    every = [machine for machines in sets for machine in machines]
    vectors = embed(every, seed) if any(len(machines) > 1 for machines in sets) else np.empty(0)
    ends = np.cumsum([len(machines) for machines in sets])
    return [
        _measure(machines, vectors[end - len(machines) : end], seed)
        for machines, end in zip(sets, ends, strict=True)
    ]


def _measure(machines: Sequence[Machine], vectors: Array, seed: int) -> Measures:
    count = len(machines)
    if count < 2:
        return Measures(count, *[Measure(None, None)] * 5)
    shapes = [Shape.of(machine) for machine in machines]
    shape = np.zeros((3, count, count))
    edits = np.zeros((count, count))
    for i in range(count):
        for j in range(i):
            shape[:, i, j] = shape[:, j, i] = shapes[i].distances(shapes[j])
            edits[i, j] = edits[j, i] = tree_edit_distance(machines[i], machines[j])
    pairs = np.tril_indices(count, -1)
    found = (*shape, cosines(vectors), edits)
    return Measures(
        count, *(Measure(float(m[pairs].mean()), bootstrap_pairs(m, seed)) for m in found)
    )
