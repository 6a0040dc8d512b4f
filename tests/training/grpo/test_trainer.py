"""What TRL's trainer makes of our advantages, with a model that has two tokens to choose from."""

# ruff: noqa: E402 - a check comes before imports of libraries that may be missing
from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.integrations.foreign import CAR
from tests.training.grpo.stand_ins import TableScorer
from tests.training.libraries import require_training

pytestmark = require_training()

import torch
from datasets import Dataset
from tokenizers import Tokenizer, models, pre_tokenizers
from transformers import LlamaConfig, LlamaForCausalLM, PreTrainedTokenizerFast
from trl import GRPOConfig as LibraryConfig

from agentflow.machine import Machine, read_machine
from agentflow.training.advantages import ADVANTAGES, pass1
from agentflow.training.grpo.config import AdvantageConfig
from agentflow.training.grpo.judging import LOST, Judged, Judging, performance
from agentflow.training.grpo.trainer import SimulationTrainer

LENGTH, SAMPLES = 3, 8
SCORES = {f"{x} {y} {z}": float(i * i) for i, (x, y, z) in enumerate(np.ndindex(2, 2, 2))}
"""Reply of three tokens, 0 or 1 -> score; all differ."""


def two_token_model() -> tuple[Any, Any]:
    """A decoder that writes 0 and 1, and its tokenizer; it never ends a reply."""
    tokenizer = Tokenizer(models.WordLevel({"0": 0, "1": 1, "<pad>": 2, "go": 3}, unk_token="go"))
    tokenizer.pre_tokenizer = pre_tokenizers.Split("", "isolated")
    fast = PreTrainedTokenizerFast(
        tokenizer_object=tokenizer, pad_token="<pad>", eos_token="<pad>", padding_side="left"
    )
    torch.manual_seed(1)
    config = LlamaConfig(
        vocab_size=4, hidden_size=8, intermediate_size=8, num_hidden_layers=1,
        num_attention_heads=1, max_position_embeddings=16, pad_token_id=2, eos_token_id=2,
        bos_token_id=None,
    )  # fmt: skip
    model = LlamaForCausalLM(config)
    with torch.no_grad():
        bias = torch.nn.Parameter(torch.tensor([0.0, 0.0, -1e4, -1e4]))
    model.lm_head = torch.nn.Linear(8, 4)
    model.lm_head.bias = bias
    model.generation_config.suppress_tokens = [2, 3]
    return model, fast


def make_trainer(
    folder: Path, advantage: AdvantageConfig, scores: dict[str, float | None], **given: Any
) -> SimulationTrainer:
    model, tokenizer = two_token_model()
    judging = Judging(TableScorer(scores, **given), performance, "auto")  # type: ignore[arg-type]
    options = LibraryConfig(
        str(folder), per_device_train_batch_size=SAMPLES, num_generations=SAMPLES,
        max_completion_length=LENGTH, loss_type="dr_grpo", beta=0.0, scale_rewards="group",
        use_cpu=True, bf16=False, report_to="none", top_k=0, max_steps=1,
        gradient_checkpointing=False, generation_kwargs={"suppress_tokens": [2, 3]},
    )  # fmt: skip
    rows = Dataset.from_list([{"prompt": "1", "task": "movement"}] * 2)
    return SimulationTrainer(
        judging=judging, advantage=advantage, model=model, args=options, train_dataset=rows,
        processing_class=tokenizer,
    )  # fmt: skip


def first_batch(trainer: SimulationTrainer) -> tuple[dict[str, Any], list[str]]:
    """The trainer's first group, and its replies."""
    trainer.model.train()
    torch.manual_seed(5)
    inputs = trainer._prepare_inputs(next(iter(trainer.get_train_dataloader())))
    texts = [" ".join(map(str, row)) for row in inputs["completion_ids"].tolist()]
    assert len(set(texts)) > 3
    trainer.current_gradient_accumulation_steps = 1  # the loop of training sets it
    return inputs, texts


def gradient(model: Any) -> Any:
    """All of it in one row."""
    return torch.cat([part.grad.flatten() for part in model.parameters() if part.grad is not None])


@pytest.mark.parametrize("name", ADVANTAGES)
def test_loss_and_gradient_are_those_of_our_advantages(name: Any, tmp_path: Path) -> None:
    trainer = make_trainer(tmp_path, AdvantageConfig(name=name, k=3), dict(SCORES))
    inputs, texts = first_batch(trainer)
    ours = torch.tensor(
        ADVANTAGES[name](np.array([SCORES[text] for text in texts]), k=3, scale=False)
    )
    assert inputs["advantages"].tolist() == pytest.approx(ours.tolist())

    loss = trainer.compute_loss(trainer.model, inputs)
    assert loss.item() == pytest.approx(-ours.mean().item(), abs=1e-5)
    loss.backward()
    found = gradient(trainer.model)
    trainer.model.zero_grad()

    ids = torch.cat([inputs["prompt_ids"], inputs["completion_ids"]], dim=1)
    logits = trainer.model(ids).logits[:, -LENGTH - 1 : -1]
    chances = logits.log_softmax(-1).gather(-1, ids[:, -LENGTH:, None]).sum((1, 2))
    (-(ours * chances).sum() / (SAMPLES * LENGTH)).backward()
    expected = torch.cat(
        [p.grad.flatten() for p in trainer.model.parameters() if p.grad is not None]
    )
    assert expected.norm() > 1e-3
    assert torch.allclose(found, expected, atol=1e-5)


def test_a_reply_without_a_score_does_not_move_the_model(tmp_path: Path) -> None:
    _, texts = first_batch(make_trainer(tmp_path, AdvantageConfig(), dict(SCORES)))
    lost = texts[0]
    trainer = make_trainer(tmp_path, AdvantageConfig(), SCORES | {lost: None})
    inputs, again = first_batch(trainer)
    assert sorted(again) == sorted(texts)
    rewards = np.array([np.nan if text == lost else SCORES[text] for text in again])
    assert inputs["advantages"].tolist() == pytest.approx(pass1(rewards).tolist())
    assert inputs["advantages"][np.isnan(rewards)].tolist() == [0] * again.count(lost)


def test_the_advantages_differ_from_the_library_s(tmp_path: Path) -> None:
    """Its own, with `scale_rewards: group`, have a deviation of 1."""
    inputs, _ = first_batch(make_trainer(tmp_path, AdvantageConfig(), dict(SCORES)))
    assert inputs["advantages"].std().item() > 5


def test_novelty_adds_the_distance_to_other_machines(tmp_path: Path) -> None:
    """Replies that begin with 1 have a car, those with 0 0 its root, the others none."""
    car = read_machine(CAR).machine
    assert car is not None
    root = Machine(car.steps[:1])
    machines = {x: car if x[0] == "1" else root for x in SCORES if x[:3] != "0 1"}
    wanted = AdvantageConfig(novelty=0.5, nearest=9)
    trainer = make_trainer(tmp_path, wanted, dict.fromkeys(SCORES, 2.0), machines=machines)
    inputs, texts = first_batch(trainer)
    cars = sum(text[0] == "1" for text in texts)
    roots = sum(text[:3] == "0 0" for text in texts)
    assert min(cars, roots) > 0
    apart = len(car) - 1
    rewards = []
    for text in texts:
        others = {"1": roots, "0": cars}[text[0]] if text in machines else 0
        rewards.append(2 + 0.5 * apart * others / (cars + roots - 1))
    assert inputs["advantages"].tolist() == pytest.approx(pass1(rewards).tolist(), abs=1e-5)


def test_unlike_mechanisms_are_rewarded(tmp_path: Path) -> None:
    trainer = make_trainer(tmp_path, AdvantageConfig(unlike=0.5), dict.fromkeys(SCORES, 2.0))
    known = [Judged(2.0, 2.0, True, True, True, None, kind) for kind in ("arm", "arm", "spring")]
    assert trainer._bonus_of([*known, LOST]).tolist() == [0.25, 0.25, 0.5, 0]


def test_training_moves_the_model_towards_the_best_reply(tmp_path: Path) -> None:
    trainer = make_trainer(tmp_path, AdvantageConfig(name="best"), dict(SCORES))
    trainer.args.max_steps, trainer.args.learning_rate = 25, 0.05
    trainer.train()
    with torch.no_grad():  # the best reply is 1 1 1, as the prompt is 1
        chances = trainer.model(torch.tensor([[1, 1, 1, 1]])).logits[0, :3].softmax(-1)[:, 1]
    assert chances.prod().item() > 0.5
