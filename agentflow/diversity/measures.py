"""How different the machines of a set are from each other: means over all pairs.

Machines are embedded as graphs: random walks over their trees are read as sentences.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import chain
from math import comb
from typing import NamedTuple

import numpy as np

from agentflow.diversity.solid import Array, Solid
from agentflow.diversity.topology import tree_edit_distance, tree_text
from agentflow.machine import Machine
from agentflow.metrics.intervals import Interval, bootstrap_pairs
from agentflow.progress import Progress, counter, silent

DIMENSIONS, WALKS, LENGTH, WINDOW = 128, 10, 80, 10
"""Length of vectors, walks from each node, nodes of a walk, reach of a context: the values of
A. Grover and J. Leskovec, "node2vec: scalable feature learning for networks", KDD 2016."""


def embed(machines: Sequence[Machine], seed: int) -> Array:
    """One vector per machine: the mean over its blocks.

    Blocks are embedded with node2vec. Its return and in-out parameters are 1, their default, so
    each step of a walk goes to a neighbour drawn uniformly. A block is named by its type and by the
    types of its parent and children; blocks of all machines that are named alike share a vector.
    The result depends on which machines are embedded together, but not on their order.

    Args:
        machines: All machines that are to be compared.
        seed: Of the walks and of the training.

    Returns:
        (machines, 128).
    """
    from gensim.models.word2vec import Word2Vec  # an extra, under the LGPL

    texts = [tree_text(machine) for machine in machines]
    graphs = {text: Graph(text) for text in set(texts)}
    rng = np.random.default_rng(seed)
    walks = list(chain.from_iterable(graphs[text].walks(rng) for text in sorted(texts)))
    vectors = Word2Vec(
        walks, vector_size=DIMENSIONS, window=WINDOW, min_count=1, sg=1, sample=0, epochs=1,
        seed=seed, workers=1,
    ).wv  # fmt: skip
    return np.stack([vectors[graphs[text].names].mean(axis=0, dtype=np.float64) for text in texts])


def cosines(vectors: Array) -> Array:
    """(n, n): cosine of the angle between each two of n vectors."""
    unit = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    found: Array = unit @ unit.T
    return found


class Graph:
    """A tree, given in bracket notation, as a graph; its nodes in preorder."""

    def __init__(self, text: str) -> None:
        from apted.helpers import Tree

        types: list[str] = []
        self._around: list[list[int]] = []
        stack = [(Tree.from_text(text), -1)]
        while stack:
            node, parent = stack.pop()
            place = len(types)
            types.append(node.name)
            self._around.append([] if parent < 0 else [parent])
            if parent >= 0:
                self._around[parent].append(place)
            stack += [(child, place) for child in reversed(node.children)]
        self.names = [self._name(place, types) for place in range(len(types))]
        """Of the nodes: type of the parent, own type, types of the children."""

    def _name(self, place: int, types: list[str]) -> str:
        above = [types[other] for other in self._around[place] if other < place]
        below = sorted(types[other] for other in self._around[place] if other > place)
        return f"{'/'.join(above)}/{types[place]}/{','.join(below)}"

    def walks(self, rng: np.random.Generator) -> list[list[str]]:
        """Uniform random walks from every node, as names of nodes."""
        if len(self.names) == 1:
            return [self.names]
        degrees = np.array([len(around) for around in self._around])
        table = np.array([around + [0] * (max(degrees) - len(around)) for around in self._around])
        at = np.tile(np.arange(len(degrees)), WALKS)
        steps = [at]
        for _ in range(LENGTH - 1):
            at = table[at, (rng.random(len(at)) * degrees[at]).astype(int)]
            steps.append(at)
        return [[self.names[place] for place in walk] for walk in np.stack(steps, axis=1).tolist()]


class Measure(NamedTuple):
    """The mean of a quantity over all pairs of machines.

    The mean is None for fewer than two machines, which form no pair, and its 95 % bootstrap
    interval over machines for fewer than three.
    """

    mean: float | None
    interval: Interval | None


@dataclass(frozen=True)
class Measures:
    """How different the machines of a set are.

    Chamfer and Hausdorff distance are in diagonals of a machine, and `iou` is from 0 to 1: see
    `solid.ShapeDistances`. The graph similarity is a cosine, -1 to 1: see `embed`. The tree edit
    distance is in blocks: see `topology.tree_edit_distance`.
    """

    machines: int
    chamfer: Measure
    hausdorff: Measure
    iou: Measure
    graph_similarity: Measure
    tree_edit_distance: Measure


def diversity(machines: Sequence[Machine], seed: int) -> Measures:
    """The measures of one set of machines; see `compare`."""
    return compare([machines], seed)[0]


def compare(sets: Sequence[Sequence[Machine]], seed: int, say: Progress = silent) -> list[Measures]:
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
