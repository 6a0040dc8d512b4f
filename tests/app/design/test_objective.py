"""The objective of a search: the score, the robust score, or a Pareto front."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import agentflow
from agentflow.app.design.config import load_config
from agentflow.app.design.evaluator import PhysicsEvaluator
from agentflow.app.design.run import RunOptions, design
from agentflow.cli import main
from agentflow.env.rollout import Feedback, Rollout
from agentflow.env.simulation.requirements import SCORE_IF_MET
from agentflow.env.simulation.variations import DEFAULT, PERTURBATIONS, Variation
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.registry import get_task
from agentflow.machine import Machine, library
from agentflow.machine.requirements import Judged, Requirement
from agentflow.metrics.machines import recorded_machine
from agentflow.runs.events import read_typed_events
from agentflow.runs.record import RunRecord
from agentflow.search.node import Evaluation
from agentflow.search.tree import is_better
from agentflow.workflows.base import pareto_front
from tests.machine.builders import CAR, build

TASK = get_task("movement")
SMALL, BLOCK = build((2, 0, 2)), build((63, 0, 4))


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
        interval: float | None = None,  # noqa: ARG002
    ) -> Rollout:
        self.asked.append(variation.name)
        score = self.known.get(variation.name.split()[0], 10.0)
        return Rollout("timeout" if score is None else "ok", score, Feedback("", {}),
                       sim_seconds=5.0, wall_seconds=1.0)  # fmt: skip


async def test_the_value_is_the_robust_score_of_ten_simulations() -> None:
    scores = Scores(default=20.0, strength=2.0)
    evaluator = PhysicsEvaluator(TASK, scores, 0, "robust")
    found = await evaluator.evaluate(CAR, "")
    assert (found.score, found.value, found.reward) == (20.0, 2.0, 2.0)
    assert scores.asked == [one.name for one in PERTURBATIONS]
    assert evaluator.worker_seconds == 10.0


async def test_by_default_one_simulation_gives_the_score() -> None:
    scores = Scores(default=20.0, strength=2.0)
    found = await PhysicsEvaluator(TASK, scores, 0).evaluate(CAR, "")
    assert (found.score, found.value, found.reward) == (20.0, None, 20.0)
    assert scores.asked == ["default"]


async def test_a_missing_condition_leaves_no_score_to_compare() -> None:
    found = await PhysicsEvaluator(TASK, Scores(friction=None), 0, "robust").evaluate(CAR, "")
    assert (found.valid, found.score, found.reward) == (True, None, None)
    assert found.details.status == "timeout"


async def test_an_invalid_machine_is_not_perturbed() -> None:
    class Refusing(Scores):
        async def run(self, *given: object, **more: object) -> Rollout:
            rollout = await super().run(*given, **more)  # type: ignore[arg-type]
            return replace(rollout, status="invalid", score=0.0)

    scores = Refusing()
    found = await PhysicsEvaluator(TASK, scores, 0, "robust").evaluate(CAR, "")
    assert (found.valid, found.reward, scores.asked) == (False, 0.0, ["default"])


async def test_pareto_compares_score_robustness_blocks_and_mass() -> None:
    evaluator = PhysicsEvaluator(TASK, Scores(default=20.0, strength=2.0), 0, "pareto")
    found = await evaluator.evaluate(CAR, "")
    weight = sum(library()[step.type].mass for step in CAR.steps)
    assert found.objectives == (20.0, 2.0, -len(CAR), pytest.approx(-weight))
    assert (found.reward, found.perfect) == (2.0, False)


async def test_what_scores_nothing_is_dominated_by_whatever_scores() -> None:
    evaluator = PhysicsEvaluator(TASK, Scores(default=0.0), 0, "pareto")
    assert (await evaluator.evaluate(CAR, "")).objectives == ()
    evaluator = PhysicsEvaluator(TASK, Scores(default=None), 0, "pareto")
    assert (await evaluator.evaluate(CAR, "")).objectives is None  # the computer failed


def test_the_front_is_sorted_by_robust_score() -> None:
    values = {
        CAR: (9.0, 5.0, -7.0, -4.0),
        SMALL: (3.0, 3.0, -2.0, -1.0),
        BLOCK: (2.0, 2.0, -2.0, -1.0),
    }
    found = [(machine, Evaluation(True, point[0], value=point[1], objectives=point))
             for machine, point in values.items()]  # fmt: skip
    assert [machine for machine, _ in pareto_front(reversed(found))] == [CAR, SMALL]
    assert pareto_front([(CAR, Evaluation(True, 1.0))]) == ()


@pytest.mark.slow
def test_a_run_records_the_front_of_all_its_machines(tmp_path: Path) -> None:
    """The front against brute force over the record, on real physics."""
    given = {"task": "movement", "workflow": "random-dsl", "trajectories": 1, "objective": "pareto",
             "max_simulations": 4, "verify": False, "start": CAR.to_json()}  # fmt: skip
    config = load_config(None, [f"{key}={json.dumps(value)}" for key, value in given.items()], {})
    result = design(config, tmp_path, RunOptions())
    path = Path(result.run)
    points = {}
    for event in RunRecord.of(read_typed_events(path)).machines.values():
        if event.valid and event.score and event.score > 0:
            machine = recorded_machine(path, event.machine)
            weight = sum(library()[step.type].mass for step in machine.steps)
            points[event.machine] = (event.score, event.robust, len(machine), round(weight, 6))
    assert len(points) >= 2
    front = {
        digest: point for digest, point in points.items()
        if not any(p != point and p[0] >= point[0] and p[1] >= point[1]
                   and p[2] <= point[2] and p[3] <= point[3] for p in points.values())
    }  # fmt: skip
    told = {one.machine: (one.score, one.robust, one.blocks, round(one.mass, 6))
            for one in result.front}  # fmt: skip
    assert told == front
    assert [one.robust for one in result.front] == sorted(
        (point[1] for point in front.values()), reverse=True
    )
    assert result.robust == result.front[0].robust
    assert main(["replay", str(path)]) == 0


def test_searches_compare_values_where_there_are_some() -> None:
    steady = Evaluation(valid=True, score=10.0, value=9.0)
    lucky = Evaluation(valid=True, score=30.0, value=1.0)
    assert is_better(steady, lucky)
    assert not is_better(lucky, steady)
    assert is_better(Evaluation(valid=True, score=30.0), Evaluation(valid=True, score=10.0))


@pytest.mark.slow
def test_a_run_tells_what_its_best_machine_meets(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Events count what is met, and a replay finds the same."""
    settings = {
        "requirements.wanted": "mass <= 1 kg, tilt <= 90 degrees",
        "settings.search.rounds": 0,
        "trajectories": 2,
        "verify": False,
    }
    found = agentflow.design("movement", workflow="single", settings=settings, out=tmp_path)
    assert found.score == 0.0
    assert [one["met"] for one in found.data["requirements"]] == [False, True]
    record = RunRecord.of(read_typed_events(found.run))
    assert {one.met for one in record.machines.values()} == {(1, 2)}
    assert {one.robust for one in record.machines.values()} == {None}
    assert main(["replay", str(found.run)]) == 0
    assert main(["show", str(found.run)]) == 0
    capsys.readouterr()


async def test_a_machine_that_misses_requirements_is_compared_by_how_much() -> None:
    judged = (Judged(Requirement.parse("mass <= 4 kg"), 5.0),)
    rollout = Rollout("ok", 0.0, Feedback("", {}), {SCORE_IF_MET: 9.0}, requirements=judged)

    class Missing(Scores):
        async def run(self, *_: Any, **__: Any) -> Rollout:
            return rollout

    task = get_task("movement", {"requirements.wanted": "mass <= 4 kg"})
    found = await PhysicsEvaluator(task, Missing(), 0).evaluate(CAR, "")
    assert (found.score, found.value, found.reward) == (0.0, None, -0.25)
    assert found.details.met == (0, 1)


@pytest.mark.slow
def test_the_embedded_designer_builds_a_safe_bridge(tmp_path: Path) -> None:
    settings = {
        "load.most": 300,
        "load.until": 2,
        "window": 3,
        "requirements.wanted": "safety >= 1.5, cost <= 60 credits",
        "max_simulations": 8,
        "verify": False,
    }
    found = agentflow.design("bridge", workflow="iterative", settings=settings, out=tmp_path)
    assert found.score == 300.0
    assert [one["met"] for one in found.data["requirements"]] == [True, True]
