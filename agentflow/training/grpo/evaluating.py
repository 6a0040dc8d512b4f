"""Samples replies between steps of training: their numbers, diversity, and the best film."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from transformers import TrainerCallback

from agentflow.agents.base import chat_prompt
from agentflow.agents.designer import Designer
from agentflow.diversity.measures import diversity
from agentflow.env.drawing.film import save_film
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.registry import get_task
from agentflow.machine import Machine, read_machine
from agentflow.models.local.folder import ModelFolder
from agentflow.models.local.loading import Sampler
from agentflow.rewards.scoring import Sample, Scorer
from agentflow.training.evaluation.replies import JudgedReply, judge, summarise
from agentflow.training.grpo.config import GrpoConfig
from agentflow.training.record import SAMPLES, TrainingRun

COMPARED = 20
"""Machines of an evaluation whose differences are measured: 190 pairs."""
FILM = (320, 240)
"""Width and height, pixels."""


class Evaluations(TrainerCallback):
    """Evaluates before the first step, every few steps, and after the last."""

    def __init__(
        self, config: GrpoConfig, folder: ModelFolder, run: TrainingRun, scorer: Scorer
    ) -> None:
        """`folder`: how the model wants prompts."""
        self._config, self._folder, self._run, self._scorer = config, folder, run, scorer

    def on_train_begin(self, _args: Any, state: Any, _control: Any, **given: Any) -> None:
        """Evaluate the model that training begins with."""
        if state.global_step == 0:
            self._evaluate(0, given["model"], given["processing_class"])

    def on_step_end(self, _args: Any, state: Any, _control: Any, **given: Any) -> None:
        """Evaluate, before a checkpoint is written."""
        step = state.global_step
        if step % self._config.eval_every == 0 or step == state.max_steps:
            self._evaluate(step, given["model"], given["processing_class"])

    def _evaluate(self, step: int, model: Any, tokenizer: Any) -> None:
        model.eval()
        sampler = Sampler(self._folder, model, tokenizer)
        replies = {task: self._judged(task, step, sampler) for task in self._config.tasks}
        model.train()
        numbers = {task: _describe(get_task(task), found, step) for task, found in replies.items()}
        every = [reply for found in replies.values() for reply in found]
        self._run.samples(step, every)
        self._run.note(step, {"eval": numbers})
        for task, found in replies.items():
            self._film_best(task, step, found)

    def _judged(self, task: str, step: int, sampler: Sampler) -> list[JudgedReply]:
        config = self._config
        prompt = chat_prompt(Designer, get_task(task, engine=config.engine).brief)
        count = -(-config.eval_samples // len(config.tasks))
        drawn = sampler.draw(prompt, count, config.seed + step, config.sampling)
        samples = [Sample(task, found.text, engine=config.engine) for found in drawn]
        return judge(samples, self._scorer)

    def _film_best(self, task: str, step: int, replies: Sequence[JudgedReply]) -> None:
        best = max(replies, key=lambda reply: reply.score or 0.0)
        level = get_task(task, engine=self._config.engine)
        machine = _machine_of(best, level)
        if machine is None or not best.score:
            return
        rollout = simulate(machine, level, seed=best.seed)
        if rollout.trace is not None:
            name = f"step-{step:06}-{task.replace('/', '-')}.gif"
            save_film(machine, level, rollout, self._run.path / SAMPLES / name, size=FILM)


def _describe(task: Task, replies: Sequence[JudgedReply], seed: int) -> dict[str, Any]:
    """The numbers of replies to one task, and how much their valid machines differ."""
    found = [_machine_of(reply, task) for reply in replies if reply.valid]
    machines = [machine for machine in found if machine is not None][:COMPARED]
    measures = diversity(machines, seed)
    means = {name: measure.mean for name, measure in vars(measures).items() if name != "machines"}
    numbers = summarise(replies, seed).to_json()
    return numbers | {"diversity": means | {"machines": len(machines)}}


def _machine_of(reply: JudgedReply, task: Task) -> Machine | None:
    return read_machine(reply.machine, task.brief.blocks, task.brief.given).machine
