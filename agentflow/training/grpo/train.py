"""Reinforcement learning of a model from a folder, in a training directory, and its evaluations."""

import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from itertools import cycle, islice
from pathlib import Path
from types import MappingProxyType
from typing import Any

from datasets import Dataset
from transformers import AutoModelForCausalLM, TrainerCallback
from trl import GRPOConfig as LibraryConfig

from agentflow.agents.base import chat_prompt
from agentflow.agents.designer import Designer
from agentflow.agents.tool_agent import Agent
from agentflow.diversity.measures import diversity
from agentflow.env.drawing.film import save_film
from agentflow.env.pool.pool import OpenPool, RolloutPool
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.registry import get_task
from agentflow.errors import ConfigError
from agentflow.machine import Machine, read_machine
from agentflow.models.local.folder import ModelFolder
from agentflow.models.local.loading import Sampler
from agentflow.rewards import Sample, Scorer
from agentflow.runs import Notify
from agentflow.training.evaluation.replies import JudgedReply, judge, summarise
from agentflow.training.grpo.config import GrpoConfig
from agentflow.training.grpo.judging import REWARDS, Judging
from agentflow.training.grpo.trainer import NUMBERS, SimulationTrainer
from agentflow.training.model import adapter_config, load_base, read_base
from agentflow.training.record import SAMPLES, About, TrainingRun, digest_base, read_curves
from agentflow.training.trainer import (
    TrainingNotes,
    library_options,
    require_one_device,
    seed_torch,
    train,
)

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


CURVES: Mapping[str, str] = MappingProxyType(
    {name: name for name in NUMBERS}
    | {
        "reward": "reward",
        "completions/mean_length": "length",
        "completions/clipped_ratio": "cut_off",
        "entropy": "entropy",
        "kl": "kl",
        "clip_ratio/region_mean": "clipped",
        "loss": "loss",
        "learning_rate": "learning_rate",
        "grad_norm": "gradient_norm",
    }
)
"""The trainer's name of a number -> its name in the curves. Lengths are in tokens, entropy and
divergence (kl) per token; `cut_off` and `clipped` are shares of the replies and tokens."""


def train_grpo(
    config: GrpoConfig,
    out: Path,
    resume: bool,
    notify: Notify,
    open_pool: OpenPool = RolloutPool,
    environment: Callable[..., Any] | None = None,
) -> Mapping[str, Any]:
    """Train a model by the rewards of its replies.

    Args:
        config: What to do.
        out: The training directory.
        resume: Continue the run in `out`, if there is one.
        notify: Receives remarks for the user.
        open_pool: Opens a pool of simulating processes.
        environment: For `config.tools`: takes the number of simulations, `engine` and `scorer`,
            and returns what makes TRL's environments; the `session` of each is its latest design,
            with `submitted` ("" for none), `lost` and `close()` as `BenchSession` has them.

    Returns:
        The content of result.json.

    Raises:
        UsageError: A task or engine does not exist, there is no such model, or it cannot call the
            tools, the directory cannot be used, or there are several GPUs or processes.
    """
    require_one_device(config)
    folder = _trained_folder(config)
    if config.tools and folder.whole_machines_only:
        raise ConfigError(f"tools need a chat model, and {config.model.name} writes only machines")
    role = Agent if config.tools else Designer
    rows = [
        {"prompt": folder.prompt(chat_prompt(role, level.brief)), "task": task}
        for task in config.tasks
        if (level := get_task(task, engine=config.engine))
    ]
    about = About(kind="grpo", label=folder.label, inputs=digest_base(config))
    with TrainingRun.open(out, about, config, resume) as run:
        if run.result is not None:
            return run.result
        if run.checkpoint is not None:
            notify(f"continuing after {run.checkpoint.name}")
        with closing(Scorer(config.workers, open_pool)) as scorer:
            factory = None
            if config.tools:
                assert environment is not None
                os.environ.setdefault("TRL_EXPERIMENTAL_SILENCE", "1")
                given = {"engine": config.engine, "scorer": lambda: scorer}
                factory = environment(config.rollouts, **given)
            try:
                trainer = _make_trainer(config, rows, run, scorer, notify, factory)
            except ValueError as error:
                if not config.tools:
                    raise
                raise ConfigError(f"the model cannot be trained with tools: {error}") from None
            trainer.add_callback(Evaluations(config, folder, run, scorer))
            trained = train(trainer, folder, run)
        return run.finish(
            {
                **trained,
                "replies": config.steps * config.batch,
                "eval": next(row["eval"] for row in reversed(read_curves(out)) if "eval" in row),
            }
        )


def _trained_folder(config: GrpoConfig) -> ModelFolder:
    base = read_base(str(config.model.name))
    start = ", without a cold start" if config.fresh else ""
    label = config.label or f"{base.label}{start}, GRPO ({config.advantage.name})"
    return base.model_copy(update={"label": label})


def _make_trainer(
    config: GrpoConfig,
    rows: list[dict[str, Any]],
    run: TrainingRun,
    scorer: Scorer,
    notify: Notify,
    environment: Callable[[], Any] | None,
) -> SimulationTrainer:
    model, tokenizer = _first_model(config)
    prompts = list(islice(cycle(rows), config.steps * config.prompts))  # more would be more steps
    trainer = SimulationTrainer(
        environment_factory=environment,
        judging=Judging(scorer, REWARDS[config.reward], config.engine),
        advantage=config.advantage,
        model=model,
        args=_library_config(config, run),
        train_dataset=Dataset.from_list(prompts),
        processing_class=tokenizer,
        peft_config=adapter_config(config.peft),
        callbacks=[TrainingNotes(run, CURVES, notify)],
    )
    if trainer.ref_model is not None:  # read from where the model came from, without its adapter
        trainer.ref_model.load_state_dict(model.state_dict())
    return trainer


def _first_model(config: GrpoConfig) -> tuple[Any, Any]:
    """The model that training begins with, and its tokenizer."""
    seed_torch(config)
    model, tokenizer = load_base(config, ())
    if not config.fresh:
        return model, tokenizer
    fresh = AutoModelForCausalLM.from_config(model.config, dtype=model.dtype)
    # Its own would come from the configuration, in which training has switched the cache off.
    fresh.generation_config = model.generation_config
    return fresh, tokenizer


def _library_config(config: GrpoConfig, run: TrainingRun) -> LibraryConfig:
    return LibraryConfig(
        **library_options(config, run),
        per_device_train_batch_size=config.part,
        gradient_accumulation_steps=config.batch // config.part,
        num_generations=config.samples,
        max_completion_length=config.max_tokens,
        temperature=config.temperature,
        top_p=config.top_p,
        top_k=0,
        use_vllm=config.vllm,
        loss_type=config.loss,
        scale_rewards="none",
        beta=config.kl,
        epsilon=config.clip,
        epsilon_high=config.clip_high,
        shuffle_dataset=False,
        **config.entropy.options,
    )
