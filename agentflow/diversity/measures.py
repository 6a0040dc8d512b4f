"""How different the machines of a set are from each other: means over all pairs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import comb
from typing import NamedTuple

import numpy as np

from agentflow.diversity.embedding import cosines, embed
from agentflow.diversity.solid import Array, Solid
from agentflow.diversity.topology import tree_edit_distance
from agentflow.machine import Machine
from agentflow.metrics.intervals import Interval, bootstrap_pairs
from agentflow.progress import Progress, counter, silent


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
    """Diagonals of a machine; see `solid.ShapeDistances` for this and the next two."""
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


def compare(
    sets: Sequence[Sequence[Machine]],
    seed: int,
    say: Progress = silent,
) -> list[Measures]:
    """The measures of several sets of machines. Their graphs are embedded together.

    Args:
        sets: Machines by set; their order and the ids of their blocks do not matter.
        seed: Of the embedding and of the intervals.
        say: Told the number of pairs done, and of all pairs, after each pair.
    """
    total = sum(comb(len(machines), 2) for machines in sets)
    every = [machine for machines in sets for machine in machines]
    vectors = embed(every, seed) if total else np.empty(0)
    tick = counter(say, total)
    ends = np.cumsum([len(machines) for machines in sets])
    return [
        _measure(machines, vectors[end - len(machines) : end], seed, tick)
        for machines, end in zip(sets, ends, strict=True)
    ]


def _measure(
    machines: Sequence[Machine], vectors: Array, seed: int, tell: Callable[[], None]
) -> Measures:
    number = len(machines)
    if number < 2:
        return Measures(number, *[Measure(None, None)] * 5)
    shapes = [Solid.of(machine) for machine in machines]
    shape = np.zeros((3, number, number))
    edits = np.zeros((number, number))
    for i in range(number):
        for j in range(i):
            shape[:, i, j] = shape[:, j, i] = shapes[i].distances(shapes[j])
            edits[i, j] = edits[j, i] = tree_edit_distance(machines[i], machines[j])
            tell()
    pairs = np.tril_indices(number, -1)
    found = (*shape, cosines(vectors), edits)
    return Measures(
        number, *(Measure(float(m[pairs].mean()), bootstrap_pairs(m, seed)) for m in found)
    )
