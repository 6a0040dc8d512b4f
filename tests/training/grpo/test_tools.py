"""Reinforcement learning with the tools of a bench; what the tiny chat model says is given."""

# ruff: noqa: E402 - a check comes before imports of libraries that may be missing
from __future__ import annotations

import json
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from tests.training.libraries import require_training

pytestmark = [require_training(), pytest.mark.slow]

import trl
from trl.chat_template_utils import qwen3_chat_template

from agentflow import design_prompt, reward
from agentflow.errors import ConfigError
from agentflow.integrations.trl import bench_environment
from agentflow.models.local.folder import ModelFolder
from agentflow.training.config import TinyModel, read_config
from agentflow.training.grpo.config import GrpoConfig
from agentflow.training.grpo.train import train_grpo
from agentflow.training.model import make_decoder, train_tokenizer
from agentflow.training.record import read_training
from tests.integrations.foreign import CAR
from tests.training.grpo.test_config import TINY

NAME = "6c45a9a7"
"""What the tools call the car."""
END = "<|im_end|>"
SMALL = (
    "tasks=[movement]", "engine=mujoco", "steps=2", "prompts=1", "samples=4", "device_batch=4",
    "max_tokens=250", "eval_every=2", "eval_samples=1", "save_every=2", "reward=performance",
    "advantage={name: pass1, scale: false}", "workers=1",
)  # fmt: skip


def call(tool: str, **arguments: object) -> str:
    asked = json.dumps({"name": tool, "arguments": arguments})
    return f"<tool_call>\n{asked}\n</tool_call>{END}"


def write_model(folder: Path, prompts: str = "chat", template: str = qwen3_chat_template) -> Path:
    texts = [message["content"] for message in design_prompt("movement", role="agent")]
    tokenizer = train_tokenizer([*texts, CAR, call("check", machine=CAR)] * 20, 3000)
    tokenizer.add_special_tokens({"eos_token": END, "additional_special_tokens": ["<|im_start|>"]})
    tokenizer.chat_template = template
    small = TinyModel(hidden=16, layers=1, heads=2, feed_forward=32, positions=16384)
    model = make_decoder(small, tokenizer)
    model.resize_token_embeddings(len(tokenizer))
    model.generation_config.eos_token_id = model.config.eos_token_id = tokenizer.eos_token_id
    model.save_pretrained(folder)
    tokenizer.save_pretrained(folder)
    ModelFolder(label="tiny", prompts=prompts).save(folder)
    return folder


def config(model: Path, *settings: str) -> GrpoConfig:
    keys = {"model.name": str(model), "tools": True}
    return read_config(GrpoConfig, TINY, [*SMALL, *settings], keys)


def test_designs_with_tools_are_learned_from(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    turns: list[int] = []

    def say(self: Any, prompt_ids: list[list[int]], *_: Any, **__: Any) -> tuple[Any, None]:
        """Two of four check a car and submit it; the others only talk."""
        later = len(turns) % 3
        turns.append(len(prompt_ids))
        first = [call("check", machine=CAR)] * 2 + [f"I would build a car.{END}"] * 2
        said = (first, [call("submit", machine=NAME)] * 2, [f"Done.{END}"] * 2)[later]
        return [self.processing_class(text)["input_ids"] for text in said], None

    monkeypatch.setattr(trl.GRPOTrainer, "_generate_single_turn", say)
    out = tmp_path / "run"
    model, environment = write_model(tmp_path / "model"), partial(bench_environment, scored=False)
    train_grpo(config(model), out, resume=False, notify=print, environment=environment)
    assert turns == [4, 2, 2] * 2
    steps = [row for row in read_training(out).curves if "reward" in row]
    assert [row["step"] for row in steps] == [1, 2]
    score = reward("movement", CAR, engine="mujoco").value
    assert score is not None
    for row in steps:
        assert (row["score_max"], row["score"]) == pytest.approx((score, score / 2))
        assert (row["valid"], row["faults"]) == (0.5, 0)
        assert row["gradient_norm"] > 0


@pytest.mark.parametrize(
    ("prompts", "template", "told"),
    [
        ("shorthand", qwen3_chat_template, "tools need a chat model"),
        ("chat", "{{ messages[0].content }}", "cannot be trained with tools: .*template"),
    ],
)
def test_models_that_cannot_call_tools_are_refused(
    tmp_path: Path, prompts: str, template: str, told: str
) -> None:
    model, environment = write_model(tmp_path / "model", prompts, template), bench_environment
    with pytest.raises(ConfigError, match=told):
        train_grpo(config(model), tmp_path / "run", False, print, environment=environment)
