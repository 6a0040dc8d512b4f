"""Estimates the cost of runs, without a request or a simulation."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from agentflow.agents.registry import ROLES
from agentflow.app.design.plan import RunPlan
from agentflow.config.run import PROCEDURAL, DesignConfig
from agentflow.env.simulation.variations import (
    DEFAULT,
    PERTURBATIONS,
    Variation,
    most_variations_of,
)
from agentflow.llm.messages import Usage
from agentflow.llm.wrappers.budget import FREE
from agentflow.search.strategies import searches_whole_run
from agentflow.workflows.registry import WORKFLOWS

ROLLOUT_SECONDS = 0.2
"""Worker time for one trial with a window of 5 s; measured: 18 s for the 175 rollouts of
`agentflow design --task throwing --seed 0` on two idle cores."""
WINDOW = 5.0


@dataclass(frozen=True)
class Estimate:
    """Cost of one or several runs, without retries or rollouts shared between runs.

    `completion_tokens` are without reasoning, and `money` is None if a model has no price.
    `perturbation` counts further simulations, for robust scores, and `verification` at most those
    that verify the finalists; neither are among the rollouts. `worker_seconds` are for all
    simulations, with half of the finalists verified: others are only if they could still win.
    """

    calls: int
    prompt_tokens: int
    completion_tokens: int
    money: float | None
    rollouts: int
    perturbation: int
    verification: int
    worker_seconds: float

    def __add__(self, other: Estimate) -> Estimate:
        pairs = zip(vars(self).values(), vars(other).values(), strict=True)
        sums: list[Any] = [None if None in pair else sum(pair) for pair in pairs]
        return Estimate(*sums)

    def times(self, runs: int) -> Estimate:
        """Cost of this many runs."""
        whole: list[Any] = [None if part is None else part * runs for part in vars(self).values()]
        return Estimate(*whole)


NOTHING = Estimate(0, 0, 0, 0.0, 0, 0, 0, 0.0)


def estimate(plan: RunPlan) -> Estimate:
    """Estimated cost of a run."""
    config = plan.config
    workflow = WORKFLOWS[config.workflow]
    settings = workflow.adapt(config.settings)
    calls, most = workflow.calls_on(settings, plan.task.brief), config.model.budget.calls
    total, money = sum(calls.values()), _total_money(config, calls)
    share = 1.0 if most is None or total <= most else most / total
    tokens = [sum(count * ROLES[r].tokens[i] for r, count in calls.items()) for i in (0, 1)]
    rollouts = workflow.rollouts(settings) + workflow.retries(settings, plan.task.brief)
    rollouts = min(rollouts, settings.max_simulations or rollouts)
    verified = _rates(most_variations_of(plan.task)) if config.verify else []
    several = config.settings.objective == "score" and searches_whole_run(settings.search)
    finalists = min(rollouts, config.settings.finalists) if several else 1
    perturbed = [] if settings.objective == "score" else _rates(PERTURBATIONS)
    seconds = len(plan.task.trials(config.seed)) * ROLLOUT_SECONDS * plan.task.window / WINDOW
    return Estimate(
        calls=round(share * total),
        prompt_tokens=round(share * tokens[0]),
        completion_tokens=round(share * tokens[1]),
        money=None if money is None else share * money,
        rollouts=rollouts,
        perturbation=rollouts * len(perturbed),
        verification=finalists * len(verified),
        worker_seconds=(rollouts * (1 + sum(perturbed)) + (1 + finalists) / 2 * sum(verified))
        * seconds,
    )


def _rates(variations: Iterable[Variation]) -> list[float]:
    """The step rates, as factors, of the variations besides the default."""
    return [variation.rate for variation in variations if variation is not DEFAULT]


def _total_money(config: DesignConfig, calls: Mapping[str, int]) -> float | None:
    """Where a search chooses among models, as if the dearest of them were always asked."""
    model, spent = config.model, 0.0
    for role, count in calls.items():
        own = model.roles.get(ROLES[role].model_role or role)
        names = (own.name,) if own else config.settings.model_arms or (model.name,)
        local = PROCEDURAL if own or not model.local else model.name
        prices = [FREE if name in (PROCEDURAL, local) else model.prices.get(name) for name in names]
        prompt, completion = ROLES[role].tokens
        usage = Usage(prompt=prompt, completion=completion)
        costs = [price.of(usage) for price in prices if price is not None]
        if count and len(costs) < len(names):
            return None
        spent += count * max(costs, default=0.0)
    return spent
