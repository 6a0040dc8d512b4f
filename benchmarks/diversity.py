"""How measures of diversity change with choices that the paper leaves open, and what they cost."""

from __future__ import annotations

import argparse
import dataclasses
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import combinations
from pathlib import Path
from random import Random
from statistics import fmean
from types import ModuleType
from typing import Any

import gensim.models.word2vec as gensim
import numpy as np

from agentflow.app.diversity.results import read_sources
from agentflow.diversity import measures, solid
from agentflow.diversity.measures import cosines, embed
from agentflow.diversity.solid import Solid, surface_points
from agentflow.diversity.topology import tree_edit_distance
from agentflow.machine import Machine
from agentflow.machine.edits.random import random_machine

MOST = 20
"""Machines of a source."""
WORD2VEC = gensim.Word2Vec


@contextmanager
def changed(module: ModuleType, **values: object) -> Iterator[None]:
    """Give constants of a module other values."""
    before = {name: getattr(module, name) for name in values}
    vars(module).update(values)
    try:
        yield
    finally:
        vars(module).update(before)


def word2vec(**options: object) -> Callable[..., Any]:
    """Word2Vec with other options."""
    return lambda walks, **ours: WORD2VEC(walks, **{**ours, **options})


def shape_means(shapes: Sequence[Solid]) -> list[float]:
    """Mean Chamfer and Hausdorff distance and IoU over all pairs."""
    found = [a.distances(b) for a, b in combinations(shapes, 2)]
    return [fmean(values) for values in zip(*found, strict=True)]


def row(label: str, cells: Sequence[float]) -> None:
    """Print a row of a Markdown table."""
    print(f"| {label} | {' | '.join(f'{cell:.3f}' for cell in cells)} |", flush=True)


def measure_shapes(sets: dict[str, list[Machine]]) -> None:
    """Points on surfaces, cells of the grid, two-ended blocks."""
    plain = {name: [Solid.of(m) for m in machines] for name, machines in sets.items()}
    for name, shapes in plain.items():
        for count in (512, 2048, 8192):
            with changed(solid, POINTS=count):
                row(
                    f"{name}, {count} points",
                    shape_means([dataclasses.replace(s) for s in shapes])[:2],
                )
        others = [sampled_again(s) for s in shapes]
        again = [a.distances(b)[:2] for a, b in zip(shapes, others, strict=True)]
        row(f"{name}, same machine, other points", np.mean(again, axis=0).tolist())
        for cells in (16, 32, 64):
            with changed(solid, CELLS=cells):
                row(f"{name}, {cells} cells", shape_means(shapes)[2:])
        bare = [dataclasses.replace(s, ends=s.ends[:0]) for s in shapes]
        row(f"{name}, without two-ended blocks", shape_means(bare))


def sampled_again(one: Solid) -> Solid:
    """The same solid with other random points."""
    other = dataclasses.replace(one)
    vars(other)["points"] = surface_points(one, 2 * solid.POINTS)[solid.POINTS :]
    return other


def measure_graphs(sets: dict[str, list[Machine]]) -> None:
    """Walks and training."""
    every = [machine for machines in sets.values() for machine in machines]
    ends = np.cumsum([len(machines) for machines in sets.values()])
    starts = [0, *ends[:-1]]

    def similarities(label: str, seed: int = 0) -> None:
        began = time.process_time()
        found = cosines(embed(every, seed))
        took = time.process_time() - began
        parts = [found[a:b, a:b] for a, b in zip(starts, ends, strict=True)]
        row(label, [*(p[np.tril_indices(len(p), -1)].mean() for p in parts), took])

    print(f"| graph similarity | {' | '.join(sets)} | seconds |")
    similarities("ours")
    similarities("another seed", 1)
    for name, values in (("WALKS", (2, 20)), ("LENGTH", (20, 40)), ("WINDOW", (2, 5)),
                         ("DIMENSIONS", (16, 64))):  # fmt: skip
        for value in values:
            with changed(measures, **{name: value}):
                similarities(f"{name} {value}")
    for options in ({"epochs": 5}, {"sample": 1e-3}, {"sg": 0}, {"sg": 0, "epochs": 5}):
        with changed(gensim, Word2Vec=word2vec(**options)):
            similarities(str(options))


def measure_time() -> None:
    """Processor time for 20 random machines of 40 blocks."""
    rng = Random(0)
    machines = [random_machine(rng, size=(40, 40)) for _ in range(MOST)]
    pairs = list(combinations(range(MOST), 2))

    def clock(label: str, work: Callable[[], object]) -> None:
        began = time.process_time()
        work()
        print(f"| {label} | {time.process_time() - began:.2f} s |", flush=True)

    shapes = [Solid.of(machine) for machine in machines]
    clock("points on surfaces", lambda: [(s.points, s.tree) for s in shapes])
    clock("distances of shapes", lambda: [shapes[a].distances(shapes[b]) for a, b in pairs])
    clock("walks and training", lambda: embed(machines, 0))
    clock(
        "tree edit distances",
        lambda: [tree_edit_distance(machines[a], machines[b]) for a, b in pairs],
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sources", type=Path, nargs="*", help="as for agentflow diversity")
    paths = parser.parse_args().sources
    sources = [source for path in paths for source in read_sources(path, valid=False)]
    sets = {source.name: list(source.machines[:MOST]) for source in sources}
    if sets:
        measure_shapes(sets)
        measure_graphs(sets)
    measure_time()


if __name__ == "__main__":
    main()
