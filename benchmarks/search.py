"""Compares the search strategies at equal expansions on three synthetic domains.

    python benchmarks/search.py [--seeds 200] [--rounds 20] [--width 4]

Candidates are points of a grid, a refinement is a random step, and some refinements are refused.
MCTS-style and best-of-N search make `rounds` expansions of `width` children each. Random search
makes one child per expansion, so it is also run with `rounds` x `width` expansions, which costs as
many evaluations. `smooth` has one hill, `deceptive` a broad low hill far from a narrow high one,
and `noisy` one hill covered with bumps. Scores are relative to the highest point. MAP-Elites keeps
the best point of each 4 by 4 square.
"""

from __future__ import annotations

import argparse
import asyncio
import math
import random
import statistics
from collections.abc import Callable, Sequence

from agentflow.search.elites.axes import Axis, Measurement
from agentflow.search.node import Attempt, Evaluation, Node
from agentflow.search.registry import STRATEGIES
from agentflow.search.settings import SearchSettings
from agentflow.search.strategies import deals_budget

Point = tuple[int, int]
REFUSED = 0.3
"""Share of refinements that are refused."""
START = (0, 0)
AXES = (Axis("x", "", -18.0, 18.0, 9), Axis("y", "", -18.0, 18.0, 9))


def smooth(point: Point) -> float:
    """One hill with its top at (12, 9)."""
    return math.exp(-math.dist(point, (12, 9)) / 8)


def deceptive(point: Point) -> float:
    """A broad hill of height 0.5 at (-9, -9) and a narrow one of height 1 at (8, 8)."""
    broad = 0.5 * math.exp(-math.dist(point, (-9, -9)) / 10)
    return max(broad, math.exp(-((math.dist(point, (8, 8)) / 4) ** 2)))


def noisy(point: Point) -> float:
    """The smooth hill with a fixed bump of up to 0.3 at each point."""
    bump = random.Random(f"bump/{point}").uniform(-0.3, 0.0)
    return max(0.0, smooth(point) + bump)


DOMAINS: dict[str, Callable[[Point], float]] = {
    "smooth": smooth,
    "deceptive": deceptive,
    "noisy": noisy,
}


class Field:
    """Random steps on one domain; a step depends only on seed, point and label."""

    def __init__(self, domain: Callable[[Point], float], seed: int) -> None:
        self._domain, self._seed = domain, seed

    async def expand(
        self, node: Node[Point], labels: Sequence[str], _earlier: Sequence[Attempt[Point]]
    ) -> list[Attempt[Point]]:
        """One random step per label, some refused."""
        return [self._step(node.candidate, label) for label in labels]

    def _step(self, point: Point, label: str) -> Attempt[Point]:
        chance = random.Random(f"{self._seed}/{point}/{label}")
        if chance.random() < REFUSED:
            return Attempt(label, None, "refused")
        x, y = point
        return Attempt(label, (x + chance.randint(-3, 3), y + chance.randint(-3, 3)), "")

    async def evaluate(self, point: Point, _label: str) -> Evaluation:
        """The height at a point."""
        return judge(point, self._domain)


def judge(point: Point, domain: Callable[[Point], float]) -> Evaluation:
    """The height at a point, and where the point is."""
    found = tuple(Measurement(axis, value) for axis, value in zip(AXES, point, strict=True))
    return Evaluation(True, domain(point), measurements=found)


async def run_search(
    name: str, domain: str, seed: int, settings: SearchSettings
) -> tuple[float, ...]:
    """Result, best candidate, expansions, attempts and evaluations of one search."""
    field = Field(DOMAINS[domain], seed)
    root = judge(START, DOMAINS[domain])
    found = await STRATEGIES[name](START, root, field.expand, field.evaluate, settings)
    score = [found.nodes[node].evaluation.score or 0.0 for node in (found.result, found.best)]
    return (*score, found.cost.expansions, found.cost.attempts, found.cost.rollouts)


def main() -> None:
    """Print one row per domain and strategy."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=200)
    parser.add_argument("--rounds", type=int, default=20)
    parser.add_argument("--width", type=int, default=4)
    options = parser.parse_args()
    equal = SearchSettings(rounds=options.rounds, width=options.width)
    longer = equal.model_copy(update={"rounds": options.rounds * options.width})
    ways = [(name, name, equal) for name in STRATEGIES if not deals_budget(name)]
    ways.append((f"random x{options.width}", "random", longer))
    print(f"{options.seeds} seeds; mean (standard error) of the result, mean of the best candidate")
    print(
        f"{'domain':<10} {'strategy':<10} {'result':>15} {'best':>9} "
        f"{'expansions':>11} {'attempts':>9} {'rollouts':>9}"
    )
    for domain in DOMAINS:
        for label, name, settings in ways:
            rows = [
                asyncio.run(run_search(name, domain, seed, settings))
                for seed in range(options.seeds)
            ]
            result, best, *costs = (list(column) for column in zip(*rows, strict=True))
            error = statistics.stdev(result) / math.sqrt(len(result)) if len(result) > 1 else 0.0
            means = [statistics.fmean(column) for column in costs]
            print(
                f"{domain:<10} {label:<10} {statistics.fmean(result):>7.3f} ({error:.3f}) "
                f"{statistics.fmean(best):>9.3f} {means[0]:>11.1f} {means[1]:>9.1f} "
                f"{means[2]:>9.1f}"
            )


if __name__ == "__main__":
    main()
