"""Owns what a sweep will probably cost, before anything is asked or simulated."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from agentflow.agents.registry import ROLES
from agentflow.app.design.conduct import Plan
from agentflow.config.run import PROCEDURAL, DesignConfig
from agentflow.env.tasks.base import Task
from agentflow.llm.messages import Usage
from agentflow.llm.wrappers.prices import Price
from agentflow.workflows.settings import WorkflowSettings

STRUCTURES = 4
"""Structures of a usual blueprint; measured: runs/recorded-throwing."""
ROLLOUT_SECONDS = 0.2
"""Of a worker, for one trial in a window of 5 s; measured: 18 s for the 175 rollouts of
`agentflow design --task throwing --seed 0` on two quiet cores."""
WINDOW = 5.0


@dataclass(frozen=True)
class Estimate:
    """Of one run or of several; without retries, and without rollouts that runs share."""

    calls: int
    prompt: int
    """Tokens."""
    completion: int
    """Tokens, without reasoning."""
    money: float | None
    """None where a model has no price."""
    rollouts: int
    seconds: float
    """Of one worker's time, for the rollouts alone."""

    def __add__(self, other: Estimate) -> Estimate:
        unknown = self.money is None or other.money is None
        return Estimate(
            self.calls + other.calls,
            self.prompt + other.prompt,
            self.completion + other.completion,
            None if unknown else (self.money or 0.0) + (other.money or 0.0),
            self.rollouts + other.rollouts,
            self.seconds + other.seconds,
        )

    def times(self, runs: int) -> Estimate:
        """Of so many runs like this one."""
        whole = (self.calls * runs, self.prompt * runs, self.completion * runs)
        money = None if self.money is None else self.money * runs
        return Estimate(*whole, money, self.rollouts * runs, self.seconds * runs)


NOTHING = Estimate(0, 0, 0, 0.0, 0, 0.0)


def estimate(plan: Plan) -> Estimate:
    """What a run will probably cost."""
    config = plan.config
    calls = _calls(config.workflow, config.settings)
    rollouts = _rollouts(config.workflow, config.settings)
    prompt = sum(count * ROLES[role].tokens[0] for role, count in calls.items())
    completion = sum(count * ROLES[role].tokens[1] for role, count in calls.items())
    return Estimate(
        sum(calls.values()),
        prompt,
        completion,
        _money(config, calls),
        rollouts,
        rollouts * _seconds(plan.task, config.seed),
    )


def total(estimates: Iterable[Estimate]) -> Estimate:
    """Of several runs together."""
    return sum(estimates, NOTHING)


def _calls(workflow: str, settings: WorkflowSettings) -> dict[str, int]:
    """Role -> calls when every first attempt is valid."""
    many, search = settings.trajectories, settings.search
    if workflow == "placement":
        return {"placer": settings.placements}
    if workflow == "single":
        return {"designer": many, "refiner": many * search.rounds}
    if workflow not in ("iterative", "hierarchical"):
        return {}
    planned = workflow == "hierarchical" and settings.meta_designer != "off"
    pieces = STRUCTURES * settings.candidates if planned else 1
    return {
        "meta_designer": int(planned),
        "designer": many * pieces,
        "inspector": many * settings.inspector,
        "querier": many * search.rounds * settings.asks_querier,
        "refiner": many * (1 + search.rounds * _width(settings)),
    }


def _rollouts(workflow: str, settings: WorkflowSettings) -> int:
    """Machines, when all are different and valid."""
    many, search = settings.trajectories, settings.search
    if workflow in ("placement", "random-placement"):
        return settings.placements
    if workflow == "random-dsl":
        return settings.rollouts or 3 * many
    if workflow == "single":
        return many * (1 + search.rounds)
    return many * (2 + search.rounds * _width(settings))


def _width(settings: WorkflowSettings) -> int:
    return 1 if settings.search.strategy == "random" else settings.search.width


def _seconds(task: Task, seed: int) -> float:
    return ROLLOUT_SECONDS * len(task.trials(seed)) * task.window / WINDOW


def _money(config: DesignConfig, calls: Mapping[str, int]) -> float | None:
    spent = 0.0
    for role, count in calls.items():
        own = config.model.roles.get(ROLES[role].model_role or role)
        name = own.name if own else config.model.name
        price = config.model.prices.get(name)
        if count and name != PROCEDURAL:
            if price is None:
                return None
            spent += count * _cost(price, role)
    return spent


def _cost(price: Price, role: str) -> float:
    prompt, completion = ROLES[role].tokens
    return price.of(Usage(prompt=prompt, completion=completion))
