"""TRL's GRPOTrainer with our advantages; simulations run while the model still writes.

Private methods of TRL 1.16 are extended here, so the extra `train` pins its version.
"""

import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import torch
from trl import GRPOTrainer

from agentflow.diversity.topology import tree_edit_distance
from agentflow.training.advantages import Floats, novelty, unlikeness
from agentflow.training.grpo.config import AdvantageConfig
from agentflow.training.grpo.judging import LOST, Judged, Judging

TOGETHER = 16
"""Replies written at a time on processors. A token for each of 16 takes 5.6 ms with the tiny
model, for each of 64 24 ms, as their keys and values no longer fit into the cache; and the first
replies are simulated while the others are written."""
NUMBERS = (
    *("score", "score_max", "valid", "seconds_generation", "seconds_simulation", "seconds_update"),
    *("parsed", "spatial", "non_zero", "distinct", "classes", "faults"),
)
"""What the trainer logs besides. Scores: in the unit of the task, of the replies that have one.
valid, parsed, spatial, non_zero, distinct: shares of them. classes: mechanism classes of machines
that score, over all groups of the step. seconds_simulation: how long the step
waited for simulations when all replies were written."""


class SimulationTrainer(GRPOTrainer):
    """Rewards from simulations; the advantages of groups that `agentflow` computes."""

    def __init__(self, *, judging: Judging, advantage: AdvantageConfig, **given: Any) -> None:
        """`given`: arguments of `GRPOTrainer`, of which `train_dataset` names each prompt's task.

        Every process must hold whole groups.
        """
        super().__init__(reward_funcs=[self.simulation_rewards], **given)
        self._judging, self._advantage = judging, advantage
        self._on_processor = self.accelerator.device.type == "cpu"
        self._tasks: list[str] = []
        self._rewards: Floats = np.empty(0)
        self._writing = 0.0

    def simulation_rewards(
        self,
        completions: Sequence[Any],
        task: Sequence[str],
        log_metric: Callable[[str, float], None],
        environments: Sequence[Any] = (),
        **_: Any,
    ) -> list[float | None]:
        """The rewards of replies, or of what was submitted with tools; None after a time-out or
        crash. Called by TRL."""
        began = time.perf_counter()
        texts = [_text_of(completion) for completion in completions]
        sessions = [environment.session for environment in environments]
        if sessions:
            texts = [session.submitted for session in sessions]
        judged = self._judging.collect(task, texts)
        for index, session in enumerate(sessions):
            if session.lost:
                judged[index] = LOST
            session.close()
        numbers = _describe(judged) | {
            "seconds_generation": self._writing,
            "seconds_simulation": time.perf_counter() - began,
            "distinct": len(set(texts)) / len(texts),
        }
        for name, number in numbers.items():
            log_metric(name, number)
        rewards = np.array([np.nan if one.reward is None else one.reward for one in judged])
        self._rewards = rewards.reshape(-1, self.num_generations)
        for start, group in zip(
            range(0, len(judged), self.num_generations), self._rewards, strict=True
        ):
            group += self._bonus_of(judged[start : start + self.num_generations])
        return [one.reward for one in judged]

    def log(self, logs: dict[str, float], start_time: float | None = None) -> None:
        """Add the seconds that steps spent neither writing nor waiting for simulations."""
        seconds = self._metrics["train"]
        names = ("step_time", "seconds_generation", "seconds_simulation")
        if all(name in seconds for name in names):
            spent = zip(*(seconds[name] for name in names), strict=True)
            seconds["seconds_update"] = [whole - written - wait for whole, written, wait in spent]
        super().log(logs, start_time)

    def create_model_card(self, *_: Any, **__: Any) -> None:
        """Write none: the training directory says what the model is."""

    def _generate_and_score_completions(self, inputs: list[dict[str, Any]]) -> dict[str, Any]:
        self._tasks, self._writing = [row["task"] for row in inputs], 0.0
        output: dict[str, Any] = super()._generate_and_score_completions(inputs)
        advantages = [self._advantages_of(group) for group in self._rewards]
        output["advantages"] = torch.tensor(np.concatenate(advantages)).to(output["advantages"])
        return output

    def _generate_single_turn(
        self, prompt_ids: list[list[int]], *given: Any, **named: Any
    ) -> tuple[list[list[int]], Any]:
        began, threads = time.perf_counter(), torch.get_num_threads()
        size = len(prompt_ids)
        if self._on_processor:
            size = TOGETHER
            torch.set_num_threads(1)  # more cost time with small models, and the workers need them
        written: list[list[int]] = []
        logprobs = None
        for start in range(0, len(prompt_ids), size):
            part = slice(start, start + size)
            found, logprobs = super()._generate_single_turn(prompt_ids[part], *given, **named)
            if self.environment_factories is None:
                texts = self.processing_class.batch_decode(found, skip_special_tokens=True)
                self._judging.hand_over(self._tasks[part], texts)
            written += found
        torch.set_num_threads(threads)
        self._writing += time.perf_counter() - began
        return written, logprobs

    def _advantages_of(self, rewards: Floats) -> Floats:
        wanted, k = self._advantage, self._advantage.k_at(self.state.global_step)
        return wanted.chosen(rewards, k=k, scale=wanted.scale)

    def _bonus_of(self, group: Sequence[Judged]) -> Floats:
        """What is added to the rewards of a group for machines that differ from the others."""
        wanted, bonus = self._advantage, np.zeros(len(group))
        if wanted.novelty:
            bonus += wanted.novelty * novelty(_edit_distances(group), wanted.nearest)
        if wanted.unlike:
            bonus += wanted.unlike * unlikeness([one.mechanism for one in group])
        return bonus


def _text_of(completion: Any) -> str:
    """The text of a reply, in plain form or as chat messages."""
    return completion if isinstance(completion, str) else str(completion[-1]["content"])


def _describe(judged: Sequence[Judged]) -> dict[str, float]:
    """Numbers of a step's replies; those without a score count only as faults."""
    scored = [one for one in judged if one.score is not None]
    scores = [one.score or 0.0 for one in scored]
    return {
        "score": _mean(scores),
        "score_max": max(scores, default=np.nan),
        "parsed": _mean([one.parsed for one in scored]),
        "spatial": _mean([one.spatial for one in scored]),
        "valid": _mean([one.valid for one in scored]),
        "non_zero": _mean([score > 0 for score in scores]),
        "classes": len({one.mechanism for one in scored} - {None}),
        "faults": len(judged) - len(scored),
    }


def _mean(values: Sequence[float]) -> float:
    return float(np.mean(values)) if values else np.nan


def _edit_distances(judged: Sequence[Judged]) -> Floats:
    """Tree edit distances between valid machines; NaN without one."""
    machines = [one.machine if one.valid else None for one in judged]
    distances = np.full((len(machines), len(machines)), np.nan)
    for i, one in enumerate(machines):
        for j, other in enumerate(machines[: i + 1]):
            if one is not None and other is not None:
                distances[i, j] = distances[j, i] = tree_edit_distance(one, other)
    return distances
