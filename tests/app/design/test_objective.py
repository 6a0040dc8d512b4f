"""The objective of a search: the score, or the robust score."""

from __future__ import annotations

from dataclasses import replace

from agentflow.app.design.laboratory import PhysicsLaboratory
from agentflow.env.rollout import Feedback, Rollout
from agentflow.env.simulation.variations import DEFAULT, PERTURBATIONS, Variation
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.registry import get_task
from agentflow.machine import Machine
from agentflow.search.node import Evaluation
from agentflow.search.tree import is_better
from tests.machine.builders import CAR

TASK = get_task("movement")


class Scores:
    """A simulator that knows the score under each condition."""

    def __init__(self, **known: float | None) -> None:
        self.known = known
        self.asked: list[str] = []

    async def run(
        self,
        machine: Machine,  # noqa: ARG002
        task: Task,  # noqa: ARG002
        *,
        seed: int = 0,  # noqa: ARG002
        variation: Variation = DEFAULT,
    ) -> Rollout:
        self.asked.append(variation.name)
        score = self.known.get(variation.name.split()[0], 10.0)
        return Rollout("timeout" if score is None else "ok", score, Feedback("", {}),
                       sim_seconds=5.0, wall_seconds=1.0)  # fmt: skip


async def test_the_value_is_the_robust_score_of_ten_simulations() -> None:
    scores = Scores(default=20.0, strength=2.0)
    laboratory = PhysicsLaboratory(TASK, scores, 0, "robust")
    found = await laboratory.evaluate(CAR, "")
    assert (found.score, found.value, found.reward) == (20.0, 2.0, 2.0)
    assert scores.asked == [one.name for one in PERTURBATIONS]
    assert laboratory.worker_seconds == 10.0


async def test_by_default_one_simulation_gives_the_score() -> None:
    scores = Scores(default=20.0, strength=2.0)
    found = await PhysicsLaboratory(TASK, scores, 0).evaluate(CAR, "")
    assert (found.score, found.value, found.reward) == (20.0, None, 20.0)
    assert scores.asked == ["default"]


async def test_a_missing_condition_leaves_no_score_to_compare() -> None:
    found = await PhysicsLaboratory(TASK, Scores(friction=None), 0, "robust").evaluate(CAR, "")
    assert (found.valid, found.score, found.reward) == (True, None, None)
    assert found.details.status == "timeout"


async def test_an_invalid_machine_is_not_perturbed() -> None:
    class Refusing(Scores):
        async def run(self, *given: object, **more: object) -> Rollout:
            rollout = await super().run(*given, **more)  # type: ignore[arg-type]
            return replace(rollout, status="invalid", score=0.0)

    scores = Refusing()
    found = await PhysicsLaboratory(TASK, scores, 0, "robust").evaluate(CAR, "")
    assert (found.valid, found.reward, scores.asked) == (False, 0.0, ["default"])


def test_searches_compare_values_where_there_are_some() -> None:
    steady = Evaluation(valid=True, score=10.0, value=9.0)
    lucky = Evaluation(valid=True, score=30.0, value=1.0)
    assert is_better(steady, lucky)
    assert not is_better(lucky, steady)
    assert is_better(Evaluation(valid=True, score=30.0), Evaluation(valid=True, score=10.0))
