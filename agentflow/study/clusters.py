"""Clusters of sequences of labels: who worked in a similar order."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations, groupby

import numpy as np
from rapidfuzz.distance import Levenshtein
from scipy.cluster.hierarchy import fcluster, linkage
from sklearn.metrics import silhouette_score

FEWEST = 3
"""Sequences; of two, nothing can be said about clusters."""


def condense(labels: Sequence[str]) -> tuple[str, ...]:
    """A sequence in which no label follows itself."""
    return tuple(label for label, _ in groupby(labels))


def find_clusters(sequences: Sequence[Sequence[str]]) -> list[int] | None:
    """Number of the cluster of each sequence, from 1 in the order of their first sequences.

    Distances are Levenshtein's over the length of the longer sequence; clusters are joined by
    average linkage. Their number, from 2 to one less than that of sequences, is that with the
    highest mean silhouette; of equal ones, the lowest. If all sequences are equal, there is one.

    None for fewer than three sequences.
    """
    if len(sequences) < FEWEST:
        return None
    distances = [Levenshtein.normalized_distance(a, b) for a, b in combinations(sequences, 2)]
    if not any(distances):
        return [1] * len(sequences)
    tree = linkage(distances, method="average")
    square = np.zeros((len(sequences), len(sequences)))
    square[np.triu_indices(len(sequences), k=1)] = distances
    square += square.T
    best, found = -np.inf, [1] * len(sequences)
    for wanted in range(2, len(sequences)):
        clusters = [int(number) for number in fcluster(tree, wanted, criterion="maxclust")]
        if len(set(clusters)) < 2:  # equal distances cannot be distinguished
            continue
        fit = float(silhouette_score(square, clusters, metric="precomputed"))
        if fit > best + 1e-9:
            best, found = fit, clusters
    return _renumber(found)


def _renumber(clusters: Sequence[int]) -> list[int]:
    order = {old: new for new, old in enumerate(dict.fromkeys(clusters), start=1)}
    return [order[old] for old in clusters]
