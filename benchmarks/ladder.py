"""Whether a benchmark ranks: stand-ins of known strength, in the right order, with what certainty.

    python benchmarks/ladder.py [SET] --out FOLDER [--simulations 20 64 200 1000] [--lite]
    python benchmarks/ladder.py --cards CARD:PART CARD:PART ... [--figure FILE]

The rungs, weakest first: a random machine (the part `first` with --random), the built-in designer's
first replies, and its default search with ever more simulations; none of them asks a language
model. They are parts of a benchmark with the items of SET, so the folder keeps the runs, and the
same command continues it; it also compares what is done so far. With --cards, rungs are parts of
cards that exist.

It prints the mean share of each rung over the items that all rungs have, the share of bootstrap
resamples of the items in which all means rise, and for each pair of neighbours the power of 33
items: the share of experiments in which the 95 % interval of the difference would be above 0, if
these differences have the true mean and deviation (normal approximation).
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import sqrt
from pathlib import Path
from statistics import NormalDist, fmean, stdev

import numpy as np
import yaml

from agentflow.app.benchmark.card import FIRST, ItemResult, read_card
from agentflow.app.benchmark.make import content
from agentflow.app.benchmark.plan import PART, plan_benchmark
from agentflow.app.benchmark.run import make_card, run_benchmark
from agentflow.app.sweeps.tables import read_sweep_result
from agentflow.cli.display.sweep_live import watch_sweep
from agentflow.config.run import load_document
from agentflow.config.shipped import find_config
from agentflow.errors import RunError
from agentflow.metrics.intervals import CONFIDENCE, ENDS, RESAMPLES, bootstrap_mean, seeds_needed

ITEMS = 33
"""Items of a new benchmark."""
NORMAL = NormalDist()


@dataclass(frozen=True)
class Rung:
    """A stand-in, and its share of each item that it has done."""

    name: str
    shares: Mapping[str, float]


def main() -> None:
    """Make the rungs, or read them, and compare them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("set", nargs="?", type=Path, default=Path("benchmark"))
    parser.add_argument("--out", type=Path)
    parser.add_argument("--simulations", type=int, nargs="+", default=[20, 64, 200, 1000])
    parser.add_argument("--lite", action="store_true")
    parser.add_argument("--cards", nargs="+")
    parser.add_argument("--figure", type=Path)
    given = parser.parse_args()
    if bool(given.out) == bool(given.cards):
        parser.error("give either --out or --cards")
    rungs = _read(given.cards) if given.cards else _make(given)
    for rung in [rung for rung in rungs if len(rung.shares) < 2]:
        print(f"{rung.name}: {len(rung.shares)} items are done, so it is left out", file=sys.stderr)
        rungs.remove(rung)
    items = [name for name in rungs[0].shares if all(name in rung.shares for rung in rungs)]
    if len(items) < 2:
        sys.exit(f"all rungs have {len(items)} items; continue, until they have two")
    table = np.array([[rung.shares[name] for rung in rungs] for name in items])
    print(_compare([rung.name for rung in rungs], table))
    if given.figure:
        _draw(given.figure, [rung.name for rung in rungs], table)


def _read(places: Sequence[str]) -> list[Rung]:
    found = []
    for place in places:
        path, _, part = place.rpartition(":")
        card = read_card(Path(path))
        name = card.model if len({each.rpartition(":")[0] for each in places}) > 1 else ""
        found.append(_rung(f"{name} {part}".strip(), card.items, part))
    return found


def _rung(name: str, items: Sequence[ItemResult], part: str) -> Rung:
    shares = {item.item: item.share(part) for item in items}
    return Rung(name, {item: share for item, share in shares.items() if share is not None})


def _make(given: argparse.Namespace) -> list[Rung]:
    """Do what is missing, item by item, so that what is done can be compared."""
    parts = content()["parts"]
    search = {key: value for key, value in parts["search"].items() if "calls" not in key}
    searches = {
        f"search-{count}": {
            **search, "search.strategy": "halving", "max_simulations": count, "placements": count
        }
        for count in given.simulations
    }  # fmt: skip
    document = load_document(find_config(given.set))
    document["axes"][PART] = {FIRST: parts[FIRST], **searches}
    given.out.mkdir(parents=True, exist_ok=True)
    file = given.out / "ladder.yaml"
    file.write_text(yaml.safe_dump(document, sort_keys=False))
    names = [FIRST, *searches]
    rungs = []
    for random, chosen in ((True, [FIRST]), (False, names)):
        plan = plan_benchmark(file, (), {}, lite=given.lite, random=random, parts=chosen)
        folder = given.out / ("random" if random else "procedural")
        try:
            with watch_sweep(len(plan.runs), quiet=True) as watcher:
                run_benchmark(plan, folder, watcher, jobs=1, resume=folder.exists())
        except KeyboardInterrupt:
            print("interrupted: what is done so far", file=sys.stderr)
        try:
            items = make_card(read_sweep_result(folder)).items
        except RunError as error:
            sys.exit(str(error))
        rungs += [_rung("random" * random or part, items, part) for part in chosen]
    return rungs


def _compare(names: Sequence[str], table: np.ndarray) -> str:
    """A table of the rungs; `table` is (items, rungs)."""
    draws = np.random.default_rng(0).integers(len(table), size=(RESAMPLES, len(table)))
    means = table[draws].mean(axis=1)
    rising = (np.diff(means, axis=1) > 0).all(axis=1).mean()
    lines = [
        f"{len(table)} items; all {len(names)} rungs in order in {rising:.1%} of {RESAMPLES} "
        "resamples of the items",
        "",
        "| rung | mean share | 95 % | above the rung before, in resamples | "
        f"power of {ITEMS} items | items for a power of 80 % |",
        "|---|--:|--:|--:|--:|--:|",
    ]
    for at, name in enumerate(names):
        shares = table[:, at].tolist()
        interval = bootstrap_mean(shares)
        ends = f"{interval.low:.1%} to {interval.high:.1%}" if interval else "-"
        told = ["-"] * 3
        if at:
            differences = (table[:, at] - table[:, at - 1]).tolist()
            above = (means[:, at] > means[:, at - 1]).mean()
            needed = seeds_needed(differences) if fmean(differences) > 0 else None
            told = [f"{above:.1%}", f"{_power(differences):.0%}", str(needed or "-")]
        lines.append(f"| {name} | {fmean(shares):.1%} | {ends} | {' | '.join(told)} |")
    return "\n".join(lines)


def _power(differences: Sequence[float]) -> float:
    """How often so many items would show that the mean difference is above 0."""
    spread = stdev(differences)
    if not spread:
        return float(fmean(differences) > 0)
    return NORMAL.cdf(fmean(differences) / spread * sqrt(ITEMS) - NORMAL.inv_cdf(ENDS[1]))


def _draw(file: Path, names: Sequence[str], table: np.ndarray) -> None:
    """Dots of items, and means with their intervals."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot

    figure, axis = pyplot.subplots(figsize=(6.4, 0.7 + 0.55 * len(names)))
    shift = np.random.default_rng(0).uniform(-0.18, 0.18, len(table))
    for at in range(len(names)):
        shares = table[:, at]
        axis.scatter(shares, at + shift, s=12, color="#7aa6c2", linewidths=0, zorder=2)
        interval = bootstrap_mean(shares.tolist())
        if interval:
            axis.plot(interval, [at, at], color="#1d3b53", linewidth=2, zorder=3)
        axis.plot([shares.mean()], [at], "D", color="#1d3b53", markersize=6, zorder=4)
    axis.set_yticks(range(len(names)), names)
    axis.set_xlabel(f"share (dots: items; diamonds: means with {CONFIDENCE:.0%} intervals)")
    axis.spines[["top", "right"]].set_visible(False)
    figure.tight_layout()
    figure.savefig(file)


if __name__ == "__main__":
    main()
