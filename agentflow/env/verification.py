"""Verification and robustness: in which repetitions, under which changed conditions and after
which edits a score holds."""

from __future__ import annotations

import asyncio
import statistics
from collections import defaultdict
from collections.abc import Awaitable, Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, TypeVar

import numpy as np

from agentflow.env.physics.engine import AUTO, EngineSpec
from agentflow.env.physics.engines import default_engine, installed_engines
from agentflow.env.rollout import Rollout, invalid_rollout
from agentflow.env.simulation.simulate import simulate
from agentflow.env.simulation.variations import (
    DEFAULT,
    GENERAL,
    PERHAPS_IDLE,
    Variation,
    perturbations_of,
    variations_of,
)
from agentflow.env.tasks.base import Task
from agentflow.holding import Holding
from agentflow.machine.edits.random import Neighbour
from agentflow.machine.problems import Problem
from agentflow.machine.tree import Machine
from agentflow.progress import Progress, counter

SAME_PLACE = 1e-6
"""Greatest distance of places that differ by rounding errors alone, m; chosen."""


@dataclass(frozen=True, repr=False)
class Verification:
    """The simulations of one machine under every variation that can change what it does.

    It is incomplete if a simulation timed out or crashed, which says nothing about the machine:
    `score`, `low` and `high` are then None.
    """

    rollouts: Mapping[str, Rollout]
    """By name of the variation, the default conditions first."""

    def __repr__(self) -> str:
        if self.score is None:
            return f"<Verification incomplete, {len(self.rollouts)} simulations>"
        spread = f"{self.score:.4g}, {self.low:.4g} to {self.high:.4g}"
        return f"<Verification {spread}; {self.holding}>"

    @classmethod
    def invalid(cls, problems: Sequence[Problem]) -> Verification:
        """The result of a machine that is not simulated because of these problems."""
        return cls({v.name: invalid_rollout(problems) for v in GENERAL})

    @property
    def default(self) -> Rollout:
        """The rollout under the default conditions; its score is the machine's plain score."""
        return self.rollouts[DEFAULT.name]

    @property
    def score(self) -> float | None:
        """The verified score: the median of all scores (of an even number, the mean of the middle
        two)."""
        return statistics.median(self._scores) if self._scores else None

    @property
    def mean(self) -> float | None:
        """The mean of all scores, which tells a machine that holds from one that fails in some."""
        return statistics.fmean(self._scores) if self._scores else None

    @property
    def low(self) -> float | None:
        """The lowest score."""
        return min(self._scores, default=None)

    @property
    def high(self) -> float | None:
        """The highest score."""
        return max(self._scores, default=None)

    @property
    def holding(self) -> Holding | None:
        """In which simulations the score holds; None if the verification is incomplete."""
        return Holding.of_verified(self.to_json())

    @property
    def _scores(self) -> list[float]:
        """All scores; none if any is missing."""
        found = [rollout.score for rollout in self.rollouts.values()]
        scores = [score for score in found if score is not None]
        return scores if len(scores) == len(found) else []

    def to_json(self) -> dict[str, Any]:
        """`score`, `low`, `high`, and `scores`: name, status and score of each variation."""
        scores = [
            {"variation": name, "status": rollout.status, "score": rollout.score}
            for name, rollout in self.rollouts.items()
        ]
        return {"score": self.score, "low": self.low, "high": self.high, "scores": scores}


def verify(machine: Machine, task: Task, *, seed: int = 0) -> Verification:
    """Simulate a machine under every variation, one after the other, in this process."""
    variations = variations_of(machine, task)
    return Verification(
        _without_idle({v.name: simulate(machine, task, seed=seed, variation=v) for v in variations})
    )


async def verify_async(
    machine: Machine,
    task: Task,
    run: Callable[..., Awaitable[Rollout]],
    default: Rollout | None = None,
    repeated: Sequence[Variation] = (),
) -> Verification:
    """Like `verify`, with all simulations at once.

    Args:
        machine: The machine.
        task: Its task.
        run: Simulates the machine under the variation that it gets as `variation`: the `run` of a
            pool, with its other arguments bound.
        default: The rollout under the default conditions, if there is one already.
        repeated: The variations of an earlier verification that is repeated: no others count.
    """
    found = await run_under(repeated or variations_of(machine, task), run, default)
    return Verification(found if repeated else _without_idle(found))


def _without_idle(rollouts: Mapping[str, Rollout]) -> dict[str, Rollout]:
    """The rollouts without those that a variation left as they are, but for rounding errors."""
    default = rollouts[DEFAULT.name]
    return {
        name: rollout
        for name, rollout in rollouts.items()
        if not (name in PERHAPS_IDLE and _moves_alike(rollout, default))
    }


def _moves_alike(one: Rollout, other: Rollout) -> bool:
    """Whether all blocks move along the same paths."""
    if one.trace is None or other.trace is None or one.terms.keys() != other.terms.keys():
        return False
    a, b = one.trace.centre, other.trace.centre
    return a.shape == b.shape and bool(np.allclose(a, b, rtol=0.0, atol=SAME_PLACE))


async def run_under(
    variations: Sequence[Variation],
    run: Callable[..., Awaitable[Rollout]],
    default: Rollout | None = None,
) -> dict[str, Rollout]:
    """Rollouts of one machine under variations, at once, by name; arguments as `verify_async`."""

    async def rollout_of(variation: Variation) -> Rollout:
        return default if default and variation is DEFAULT else await run(variation=variation)

    rollouts = await asyncio.gather(*map(rollout_of, variations))
    return {v.name: r for v, r in zip(variations, rollouts, strict=True)}


def other_engines(task: Task) -> list[EngineSpec]:
    """The installed engines besides that of the task."""
    used = default_engine().name if task.engine == AUTO else task.engine
    return [spec for spec in installed_engines() if spec.name != used]


async def score_on_others(
    run: Callable[..., Awaitable[Rollout]], task: Task
) -> list[dict[str, Any]]:
    """`engine`, `status` and `score` of a machine on every other engine that is installed.

    They are not part of a verification, because engines differ by more than its variations.

    Args:
        run: Simulates the machine on the task that it gets: the `run` of a pool, with its other
            arguments bound.
        task: The task; its engine is left out.
    """
    others = other_engines(task)
    rollouts = await asyncio.gather(*(run(replace(task, engine=spec.name)) for spec in others))
    return [
        {"engine": str(spec.identity), "status": rollout.status, "score": rollout.score}
        for spec, rollout in zip(others, rollouts, strict=True)
    ]


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
    """A design, its neighbours and its world (by name of the variation, the default conditions
    first), perturbed."""

    world: Mapping[str, Rollout] = field(repr=False)
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

    world, edited = await asyncio.gather(
        run_under(perturbations_of(machine), partial(counted, machine)),
        asyncio.gather(*(counted(one.machine) for one in neighbours)),
    )
    return Perturbation(world, tuple(zip(neighbours, edited, strict=True)))
