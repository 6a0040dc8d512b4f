"""Configuration of reinforcement learning."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field, field_validator, model_validator

from agentflow.llm.messages import Sampling
from agentflow.training.advantages import ADVANTAGES, Advantage
from agentflow.training.config import ConfigGroup, TrainingConfig


class AdvantageConfig(ConfigGroup):
    """How the rewards of a group of replies become advantages.

    Attributes:
        name: Formula of the advantage.
        k: For pkpo and maxpo: replies of which the best counts; or a schedule, first step: k, such
            as {0: 8, 20: 1}.
        scale: For pass1: divide by the deviation of the group.
        novelty: Weight of a machine's edit distance to others, added to rewards.
        nearest: Others to which that distance is measured.
        unlike: Weight of the share of a group's other scoring machines that are of another
            mechanism class, added to rewards.
    """

    name: str = "pass1"
    k: int | dict[int, int] = 4
    scale: bool = False
    novelty: float = Field(0.0, ge=0)
    nearest: int = Field(3, ge=1)
    unlike: float = Field(0.0, ge=0)

    @field_validator("name")
    @classmethod
    def _known(cls, name: str) -> str:
        if name not in ADVANTAGES:
            *names, last = map(repr, ADVANTAGES)
            raise ValueError(f"expected {', '.join(names)} or {last}, not {name!r}")
        return name

    @field_validator("k")
    @classmethod
    def _begins(cls, k: int | dict[int, int]) -> int | dict[int, int]:
        if isinstance(k, dict) and 0 not in k:
            raise ValueError("a schedule of k must start at step 0, as in {0: 8}")
        return k

    @model_validator(mode="after")
    def _scales(self) -> AdvantageConfig:
        if self.scale and "scale" not in self.chosen.takes:
            scaled = [name for name, each in ADVANTAGES.items() if "scale" in each.takes]
            raise ValueError(
                f"scale is for {' and '.join(scaled)} only: set advantage.scale=false for "
                f"{self.name}"
            )
        return self

    @property
    def chosen(self) -> Advantage:
        """The advantage of this name."""
        return ADVANTAGES[self.name]

    @property
    def ks(self) -> tuple[int, ...]:
        """Every k that occurs."""
        return tuple(self.k.values()) if isinstance(self.k, dict) else (self.k,)

    def k_at(self, step: int) -> int:
        """The k of a step, counted from 0."""
        if isinstance(self.k, int):
            return self.k
        return self.k[max(first for first in self.k if first <= step)]


class EntropyConfig(ConfigGroup):
    """TRL's control of entropy: a bonus in the loss, fixed or adapted to keep a target.

    Attributes:
        weight: Weight of the mean entropy of tokens in the loss.
        target: Entropy (nats per token) below which that weight grows and counts, step by step;
            None keeps it fixed.
        step: Change of an adapted weight in a step.
        most: Greatest adapted weight.
        quantile: Share of the tokens, of highest entropy, that are trained.
    """

    weight: float = Field(0.0, ge=0)
    target: float | None = Field(None, gt=0)
    step: float = Field(0.005, gt=0)
    most: float = Field(1.0, gt=0)
    quantile: float = Field(1.0, gt=0, le=1)

    @property
    def options(self) -> dict[str, Any]:
        """The same as TRL names it."""
        adapted = {} if self.target is None else {"entropy_target": self.target}
        return adapted | {
            "entropy_coef": self.weight,
            "use_adaptive_entropy": bool(adapted),
            "entropy_coef_delta": self.step,
            "entropy_coef_max": self.most,
            "top_entropy_quantile": self.quantile,
        }


class GrpoConfig(TrainingConfig):
    """Reinforcement learning: groups of replies, rewarded by simulation.

    Attributes:
        fresh: Begin with random weights, in the architecture of the model.
        tasks: Levels; steps alternate between them.
        engine: Physics engine; auto is the first that is installed.
        workers: Processes for simulations.
        reward: performance: the score, 0 for an invalid machine; shaped: also a part for each step
            towards a valid machine.
        prompts: Groups per step.
        samples: Replies per group.
        device_batch: Maximum replies per device at a time in updates; None is all.
        tools: Whether models call tools over several turns and submit a machine.
        rollouts: With tools: simulations of a design.
        max_tokens: Longer replies are cut off; with tools, their answers count.
        temperature: Sampling temperature of the replies.
        top_p: Sample from the likeliest tokens with this total probability.
        vllm: Generate with vLLM, on the same GPU.
        loss: How the losses of tokens are averaged, as TRL names it.
        kl: Weight of the divergence from the first model.
        clip: Greatest fall of a token's probability ratio.
        clip_high: Greatest rise of that ratio.
        log_every: Steps between lines of the curves.
        save_every: Steps between checkpoints.
        eval_every: Steps between evaluations.
        eval_samples: Replies of an evaluation, over all tasks.
    """

    fresh: bool = False
    tasks: tuple[str, ...] = Field(("throwing",), min_length=1)
    engine: str = "auto"
    workers: int = Field(2, ge=1)
    reward: Literal["performance", "shaped"] = "performance"
    advantage: AdvantageConfig = AdvantageConfig()
    entropy: EntropyConfig = EntropyConfig()
    prompts: int = Field(4, ge=1)
    samples: int = Field(16, ge=2)
    device_batch: int | None = Field(None, ge=1)
    tools: bool = False
    rollouts: int = Field(8, ge=1)
    max_tokens: int = Field(260, ge=1)
    temperature: float = Field(1.0, gt=0)
    top_p: float = Field(1.0, gt=0, le=1)
    vllm: bool = False
    loss: Literal["grpo", "bnpo", "dr_grpo", "dapo"] = "dr_grpo"
    kl: float = Field(0.0, ge=0)
    clip: float = Field(0.2, gt=0)
    clip_high: float = Field(0.28, gt=0)
    log_every: int = Field(1, ge=1)
    save_every: int = Field(10, ge=1)
    eval_every: int = Field(10, ge=1)
    eval_samples: int = Field(64, ge=1)

    @property
    def libraries(self) -> tuple[str, ...]:
        """What must be installed: scipy, apted and gensim measure diversity."""
        own = (*["vllm"] * self.vllm, *["jmespath"] * self.tools)
        return (*super().libraries, "scipy", "apted", "gensim", *own)

    @property
    def batch(self) -> int:
        """Replies per step."""
        return self.prompts * self.samples

    @property
    def sampling(self) -> Sampling:
        """How replies of an evaluation are drawn."""
        return Sampling(temperature=self.temperature, top_p=self.top_p, max_tokens=self.max_tokens)

    @property
    def part(self) -> int:
        """Replies of an update at a time."""
        return min(self.device_batch or self.batch, self.batch)

    @model_validator(mode="after")
    def _fits(self) -> GrpoConfig:
        most = self.samples - self.advantage.chosen.spare
        if "k" in self.advantage.chosen.takes:
            for k in self.advantage.ks:
                if not 1 <= k <= most:
                    raise ValueError(
                        f"advantage.k must be 1 to {most} for {self.advantage.name} with "
                        f"samples = {self.samples}, not {k}"
                    )
        if self.batch % self.part:
            raise ValueError(
                f"prompts * samples ({self.batch}) must be a multiple of device_batch "
                f"({self.device_batch})"
            )
        if self.model.name is None:
            raise ValueError(
                "model must name a folder with a model, such as one that train sft writes; give "
                "--model"
            )
        if self.fresh and self.kl:
            raise ValueError("kl must be 0 with fresh: random weights are not a model to stay near")
        return self
