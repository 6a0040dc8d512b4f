"""Estimates the cost of runs, without a request or a simulation."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from agentflow.agents.registry import ROLES
from agentflow.app.design.plan import RunPlan
from agentflow.config.run import PROCEDURAL, DesignConfig
from agentflow.env.simulation.variations import DEFAULT, PERTURBATIONS, VARIATIONS, Variation
from agentflow.llm.messages import Usage
from agentflow.workflows.registry import WORKFLOWS

ROLLOUT_SECONDS = 0.2
"""Worker time for one trial with a window of 5 s; measured: 18 s for the 175 rollouts of
`agentflow design --task throwing --seed 0` on two idle cores."""
WINDOW = 5.0


@dataclass(frozen=True)
class Estimate:
    """Cost of one or several runs, without retries or rollouts shared between runs."""

    calls: int
    prompt: int
    """Tokens."""
    completion: int
    """Tokens, without reasoning."""
    money: float | None
    """None if a model has no price."""
    rollouts: int
    perturbation: int
    """Further simulations of machines, for robust scores; not among the rollouts."""
    verification: int
    """Simulations to verify the best machines; not among the rollouts."""
    seconds: float
    """Worker time for all simulations."""

    def __add__(self, other: Estimate) -> Estimate:
        unknown = self.money is None or other.money is None
        return Estimate(
            self.calls + other.calls,
            self.prompt + other.prompt,
            self.completion + other.completion,
            None if unknown else (self.money or 0.0) + (other.money or 0.0),
            self.rollouts + other.rollouts,
            self.perturbation + other.perturbation,
            self.verification + other.verification,
            self.seconds + other.seconds,
        )

    def times(self, runs: int) -> Estimate:
        """Cost of this many runs."""
        whole = (self.calls * runs, self.prompt * runs, self.completion * runs)
        money = None if self.money is None else self.money * runs
        simulations = (self.rollouts * runs, self.perturbation * runs, self.verification * runs)
        return Estimate(*whole, money, *simulations, self.seconds * runs)


NOTHING = Estimate(0, 0, 0, 0.0, 0, 0, 0, 0.0)


def estimate(plan: RunPlan) -> Estimate:
    """Estimated cost of a run."""
    config = plan.config
    workflow = WORKFLOWS[config.workflow]
    settings = workflow.adapt(config.settings)
    calls = workflow.calls_on(settings, plan.task.brief)
    rollouts = workflow.rollouts(settings) + workflow.retries(settings, plan.task.brief)
    verified = _rates(VARIATIONS) if config.verify else []
    perturbed = [] if settings.objective == "score" else _rates(PERTURBATIONS)
    seconds = len(plan.task.trials(config.seed)) * ROLLOUT_SECONDS * plan.task.window / WINDOW
    return Estimate(
        calls=sum(calls.values()),
        prompt=sum(count * ROLES[role].tokens[0] for role, count in calls.items()),
        completion=sum(count * ROLES[role].tokens[1] for role, count in calls.items()),
        money=_total_money(config, calls),
        rollouts=rollouts,
        perturbation=rollouts * len(perturbed),
        verification=len(verified),
        seconds=(rollouts * (1 + sum(perturbed)) + sum(verified)) * seconds,
    )


def _rates(variations: Iterable[Variation]) -> list[float]:
    """The step rates, as factors, of the variations besides the default."""
    return [variation.rate for variation in variations if variation is not DEFAULT]


def _total_money(config: DesignConfig, calls: Mapping[str, int]) -> float | None:
    spent = 0.0
    for role, count in calls.items():
        role_model = config.model.roles.get(ROLES[role].model_role or role)
        name = role_model.name if role_model else config.model.name
        price = config.model.prices.get(name)
        free = name == PROCEDURAL or (role_model is None and config.model.local)
        if count and not free:
            if price is None:
                return None
            prompt, completion = ROLES[role].tokens
            spent += count * price.of(Usage(prompt=prompt, completion=completion))
    return spent
