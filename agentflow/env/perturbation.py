"""Robustness: scores of a design under changed conditions, and of machines one edit away."""

from __future__ import annotations

import asyncio
import statistics
from collections import defaultdict
from collections.abc import Awaitable, Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np

from agentflow.env.rollout import Rollout
from agentflow.env.simulation.variations import DEFAULT, Variation, perturbations_of
from agentflow.env.verification import run_under
from agentflow.machine.edits.neighbours import Neighbour
from agentflow.machine.tree import Machine
from agentflow.progress import Progress, counter

LOW = 0.1
"""The quantile of scores that is the robust score."""
KEPT = 0.5
"""Share of the plain score that a perturbed machine has to keep."""
_K = TypeVar("_K", bound=Hashable)


@dataclass(frozen=True)
class Spread:
    """The scores of perturbed machines."""

    plain: float | None
    """Score of the design itself; None if its simulation timed out or crashed."""
    scores: tuple[float, ...]
    missing: int = 0
    """Simulations that timed out or crashed, which says nothing about the design."""

    @classmethod
    def of(cls, plain: float | None, rollouts: Iterable[Rollout]) -> Spread:
        """Collect the scores of rollouts."""
        found = [rollout.score for rollout in rollouts]
        scores = tuple(score for score in found if score is not None)
        return cls(plain, scores, len(found) - len(scores))

    def quantile(self, share: float) -> float | None:
        """The score that this share of the scores is at most, interpolated; None if any is missing
        or there are none."""
        if self.missing or not self.scores:
            return None
        return float(np.quantile(self.scores, share))

    @property
    def kept(self) -> float | None:
        """Share of the known scores that are at least half of the plain one; None if that is not
        above 0, or nothing is known."""
        if not self.scores or self.plain is None or self.plain <= 0:
            return None
        return sum(score >= KEPT * self.plain for score in self.scores) / len(self.scores)

    def to_json(self) -> dict[str, Any]:
        """`count`, `missing`, `kept`, the quantiles 0, 10, 25, 50, 75, 100 %, and `scores`."""
        shares = (0.0, LOW, 0.25, 0.5, 0.75, 1.0)
        return {
            "count": len(self.scores),
            "missing": self.missing,
            "kept": self.kept,
            "quantiles": {f"{round(100 * share)} %": self.quantile(share) for share in shares},
            "scores": list(self.scores),
        }


@dataclass(frozen=True)
class Perturbation:
    """A design, its neighbours and its world, perturbed."""

    world: Mapping[str, Rollout] = field(repr=False)
    """By name of the variation, the default conditions first."""
    edits: Sequence[tuple[Neighbour, Rollout]] = field(repr=False)

    @property
    def default(self) -> Rollout:
        """The rollout of the design under the default conditions."""
        return self.world[DEFAULT.name]

    @property
    def world_spread(self) -> Spread:
        """Scores of the design under all conditions, the default ones included."""
        return Spread.of(self.default.score, self.world.values())

    @property
    def edits_spread(self) -> Spread:
        """Scores of the neighbours."""
        return Spread.of(self.default.score, (rollout for _, rollout in self.edits))

    @property
    def robust(self) -> float | None:
        """The robust score: the 10 % quantile of the scores under all conditions."""
        return robust_score(self.world)

    @property
    def blocks(self) -> dict[int, float]:
        """Block -> mean score of the neighbours that change or remove it; the lowest first."""
        return _rank((n.block, r) for n, r in self.edits if n.block is not None)

    @property
    def faces(self) -> dict[tuple[int, int], float]:
        """(block, face) -> mean score of the neighbours that add a block there, or change or remove
        the one there; the lowest first."""
        return _rank((face, r) for n, r in self.edits for face in n.faces)


def robust_score(world: Mapping[str, Rollout]) -> float | None:
    """The 10 % quantile of the scores under all conditions; None if any is missing."""
    return Spread.of(None, world.values()).quantile(LOW)


def _rank(found: Iterable[tuple[_K, Rollout]]) -> dict[_K, float]:
    scores: dict[_K, list[float]] = defaultdict(list)
    for key, rollout in found:
        if rollout.score is not None:
            scores[key].append(rollout.score)
    means = {key: statistics.mean(values) for key, values in scores.items()}
    return dict(sorted(means.items(), key=lambda item: item[1]))


async def perturb(
    machine: Machine,
    neighbours: Sequence[Neighbour],
    run: Callable[..., Awaitable[Rollout]],
    say: Progress,
) -> Perturbation:
    """Simulate a machine under all conditions, and its neighbours under the default ones.

    Args:
        machine: The design.
        neighbours: Machines one edit away.
        run: Simulates the machine that it gets, under the `variation` that it gets if any.
        say: Told the number of simulations done, and of all.
    """
    tick = counter(say, len(perturbations_of(machine)) + len(neighbours))

    async def counted(one: Machine, variation: Variation = DEFAULT) -> Rollout:
        rollout = await run(one, variation=variation)
        tick()
        return rollout

    async def of_machine(variation: Variation) -> Rollout:
        return await counted(machine, variation)

    world, edited = await asyncio.gather(
        run_under(perturbations_of(machine), of_machine),
        asyncio.gather(*(counted(one.machine) for one in neighbours)),
    )
    return Perturbation(world, tuple(zip(neighbours, edited, strict=True)))
