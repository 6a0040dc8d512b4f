"""An evaluator of machines for libraries that evolve texts: GEPA, OpenEvolve and ShinkaEvolve.

It needs nothing but agentflow itself. Candidates are machines as text, never programs that run.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from agentflow.env.physics.engine import AUTO
from agentflow.env.tasks.registry import get_task
from agentflow.machine import check, read_machine
from agentflow.rewards import Reward, Sample, require_score, reward_async, shared_scorer

Candidate = str | Mapping[str, str]
"""The text of a machine in any format, or named texts with that as the only one."""


class Evaluator:
    """Scores candidates at one task, and says what happened, for a model that improves them."""

    def __init__(
        self,
        task: str,
        seed: int = 0,
        *,
        knobs: Mapping[str, object] | None = None,
        engine: str = AUTO,
        workers: int | None = None,
    ) -> None:
        """Evaluate at a level.

        Args:
            task: Level, such as "throwing/3".
            seed: Random seed of its trials.
            knobs: Knobs of the level to change.
            engine: Physics engine.
            workers: Worker processes; by default one per processor.

        Raises:
            UsageError: The task, a knob or the engine does not exist.
        """
        self._level = get_task(task, knobs, engine)
        self._workers = workers
        self._sample = Sample(task, "", seed, knobs, engine)

    def __call__(
        self, candidate: Candidate, *_example: object, **_options: object
    ) -> tuple[float, dict[str, Any]]:
        """What GEPA's `optimize_anything` calls: the score, and what to tell the model.

        Raises:
            NoScoreError: The simulation timed out or crashed, which says nothing about the machine.
        """
        return self.batch([(candidate, None)])[0]

    def batch(
        self, pairs: Sequence[tuple[Candidate, object]], **_options: object
    ) -> list[tuple[float, dict[str, Any]]]:
        """The same for many candidates, simulated side by side: GEPA's `batch_evaluator`.

        Raises:
            NoScoreError: A simulation timed out or crashed.
        """
        found = self._rewards([_text_of(candidate) for candidate, _ in pairs])
        scores = [require_score(reward, self._sample.task) for reward in found]
        return [
            (score, {"scores": {"score": score}, "Feedback": _feedback(reward)})
            for score, reward in zip(scores, found, strict=True)
        ]

    def check(self, path: str | Path) -> dict[str, Any]:
        """The validity of a machine file without a simulation, as a first stage of a cascade."""
        brief = self._level.brief
        report = check(read_machine(_read(path), brief.blocks, brief.given), brief)
        words = "\n".join(problem.message for problem in report.lasting_problems)
        return {"metrics": {"valid": float(not words)}, "artifacts": {"feedback": words}}

    def evaluate(self, path: str | Path) -> dict[str, Any]:
        """`metrics` and `artifacts` of a machine file, as in OpenEvolve's `EvaluationResult`.

        Raises:
            NoScoreError: The simulation timed out or crashed.
        """
        return self._judged(self._rewards([_read(path)])[0])

    def first_trial(self, path: str | Path) -> dict[str, Any]:
        """As `evaluate`, by the first trial alone where a task has several: a second stage.

        Raises:
            NoScoreError: The simulation timed out or crashed.
        """
        scorer, trial = shared_scorer(self._workers), self._level.trials(self._sample.seed)[0]
        work = reward_async(trial, _read(path), scorer.pool, self._sample.seed)
        return self._judged(scorer.wait_for(work))

    def write(self, path: str | Path, folder: str | Path) -> None:
        """Evaluate a machine file, and write the `metrics.json` and `correct.json` that
        ShinkaEvolve reads.

        A machine without a score is not correct: its generation is left out.
        """
        [reward] = self._rewards([_read(path)])
        words = _feedback(reward)
        correct = reward.valid and reward.value is not None
        metrics = {"combined_score": reward.value, "text_feedback": words} if correct else {}
        told = {"correct": correct, "error": None if correct else words}
        for name, data in (("metrics", metrics), ("correct", told)):
            (Path(folder) / f"{name}.json").write_text(json.dumps(data), encoding="utf-8")

    def _rewards(self, texts: Sequence[str]) -> list[Reward]:
        samples = [replace(self._sample, text=text) for text in texts]
        return shared_scorer(self._workers).rewards(samples)

    def _judged(self, reward: Reward) -> dict[str, Any]:
        score = require_score(reward, self._sample.task)
        metrics = {"combined_score": score, "valid": float(reward.valid)}
        return {"metrics": metrics, "artifacts": {"feedback": _feedback(reward)}}


def _read(path: str | Path) -> str:
    return Path(path).read_text(encoding="utf-8", errors="replace")


def _text_of(candidate: Candidate) -> str:
    return candidate if isinstance(candidate, str) else "\n".join(candidate.values())


def _feedback(reward: Reward) -> str:
    return reward.rollout.feedback.text


evaluator = Evaluator
"""The name that `agentflow` offers."""
