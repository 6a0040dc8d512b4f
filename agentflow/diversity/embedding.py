"""Embed machines as graphs: random walks over their trees, read as sentences."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain

import numpy as np

from agentflow.diversity.solid import Array
from agentflow.diversity.topology import tree_text
from agentflow.machine import Machine

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
