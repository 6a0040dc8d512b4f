"""Reinforcement learning of a tiny model that has learned one car by heart; real physics."""

# ruff: noqa: E402 - a check comes before imports of libraries that may be missing
from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from tests.training.libraries import require_training

pytestmark = [require_training(), pytest.mark.slow]

import torch
from peft import LoraConfig, get_peft_model
from transformers import AutoConfig, GenerationConfig

from agentflow import design_prompt
from agentflow.errors import ConfigError, RunError
from agentflow.llm.messages import Sampling
from agentflow.models.local.folder import ModelFolder, shorten
from agentflow.models.local.loading import load_model
from agentflow.training.config import TinyModel, read_config
from agentflow.training.evaluation.replies import JudgedReply
from agentflow.training.grpo.config import GrpoConfig
from agentflow.training.grpo.train import CURVES, train_grpo
from agentflow.training.model import load_base, make_decoder, train_tokenizer
from agentflow.training.record import digest_model, read_training
from tests.integrations.foreign import CAR
from tests.training.grpo.test_config import TINY

REPLY = f"A car. ```json {json.dumps(json.loads(CAR))}```"
SMALL = (
    "tasks=[movement]", "engine=auto", "steps=4", "prompts=2", "samples=4", "device_batch=4",
    "max_tokens=120", "eval_every=2", "eval_samples=4", "save_every=2", "temperature=1.3",
    "advantage={name: maxpo, k: 2, scale: false}",
)  # fmt: skip


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a model that has learned the car by heart."""
    folder = tmp_path_factory.mktemp("car")
    text = shorten(design_prompt("movement")) + REPLY
    tokenizer = train_tokenizer([text] * 20, 330)
    torch.manual_seed(0)
    small = TinyModel(hidden=32, layers=1, heads=2, feed_forward=64)
    model = make_decoder(small, tokenizer)
    ids = tokenizer(text + str(tokenizer.eos_token), return_tensors="pt")["input_ids"]
    optimiser = torch.optim.Adam(model.parameters(), 1e-2)
    for _ in range(150):
        optimiser.zero_grad()
        model(ids, labels=ids).loss.backward()
        optimiser.step()
    model.save_pretrained(folder)
    tokenizer.save_pretrained(folder)
    ModelFolder(label="tiny model that knows one car", prompts="shorthand").save(folder)
    return folder


def config(model: Path, *settings: str) -> GrpoConfig:
    return read_config(GrpoConfig, TINY, [*SMALL, *settings], {"model.name": str(model)})


def curve(out: Path) -> list[dict[str, Any]]:
    """Lines of the curves without times."""
    rows = read_training(out).curves
    return [{k: v for k, v in row.items() if not k.startswith("seconds")} for row in rows]


def test_training_leaves_curves_samples_films_and_a_model(model: Path, tmp_path: Path) -> None:
    out, told = tmp_path / "run", list[str]()
    result = train_grpo(config(model), out, resume=False, notify=told.append)
    label = "tiny model that knows one car, GRPO (maxpo)"
    assert (result["label"], result["steps"], result["replies"]) == (label, 4, 32)
    assert read_training(out).about.inputs == {"model.name": digest_model(model)}
    rows = read_training(out).curves
    assert [row["step"] for row in rows] == [0, 1, 2, 3, 4]
    assert {*CURVES.values()} - {"kl"} <= set(rows[1])
    assert max(row["score_max"] for row in rows[1:]) > 10, "the car drives"
    assert all(0 < row["valid"] <= 1 for row in rows[1:])
    assert all(row["seconds_generation"] > 0 < row["seconds_update"] for row in rows[1:])
    assert rows[4]["eval"]["movement"]["best_at"]["4"] == rows[4]["eval"]["movement"]["max"]
    assert rows[4]["eval"]["movement"] == json.loads(json.dumps(result["eval"]["movement"]))

    lines = (out / "samples" / "step-000004.jsonl").read_text().splitlines()
    replies = [JudgedReply.model_validate_json(line) for line in lines]
    assert [reply.task for reply in replies] == ["movement"] * 4
    assert (out / "samples" / "step-000004-movement.gif").read_bytes().startswith(b"GIF8")
    found = load_model(out / "model", "cpu")
    assert found.folder.label == label
    assert len(found.draw(design_prompt("movement"), 2, 1, Sampling(max_tokens=9))) == 2
    assert sum(line.startswith("step ") for line in told) == 4
    again = train_grpo(config(model), out, resume=True, notify=told.append)
    assert again == json.loads(json.dumps(result)), "a finished run is not trained again"


def test_an_interrupted_run_continues_with_the_same_curve(model: Path, tmp_path: Path) -> None:
    whole, broken = tmp_path / "whole", tmp_path / "broken"
    train_grpo(config(model), whole, resume=False, notify=lambda _: None)

    def interrupt(line: str) -> None:
        if line.startswith("step 3"):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train_grpo(config(model), broken, resume=False, notify=interrupt)
    assert [row["step"] for row in curve(broken)] == [0, 1, 2, 3]
    with pytest.raises(RunError, match="continue it with --resume"):
        train_grpo(config(model), broken, resume=False, notify=interrupt)
    told: list[str] = []
    train_grpo(config(model), broken, resume=True, notify=told.append)
    assert told[0] == "continuing after checkpoint-2"
    assert curve(broken) == curve(whole)
    one, other = (load_model(out / "model", "cpu").model.state_dict() for out in (whole, broken))
    assert all(torch.equal(one[name], other[name]) for name in one)


def test_a_run_that_was_killed_after_its_last_step_only_saves_the_model(
    model: Path, tmp_path: Path
) -> None:
    tasks = "tasks=[movement, movement/2, movement/3]"
    wanted = config(model, tasks, "steps=2", "prompts=1", "max_tokens=20", "eval_samples=3")
    result = train_grpo(wanted, tmp_path, resume=False, notify=lambda _: None)
    before = curve(tmp_path)
    (tmp_path / "result.json").unlink()
    shutil.rmtree(tmp_path / "model")
    again = train_grpo(wanted, tmp_path, resume=True, notify=lambda _: None)
    assert curve(tmp_path) == before
    assert again["eval"] == result["eval"]
    assert (tmp_path / "model" / "config.json").exists()


def test_fresh_weights_know_nothing_of_the_car(model: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(model, tmp_path / "trained")
    AutoConfig.from_pretrained(folder, use_cache=False).save_pretrained(folder)  # as TRL leaves it
    wanted = config(folder, "fresh=true", "steps=1", "save_every=1", "max_tokens=20")
    result = train_grpo(wanted, tmp_path / "run", resume=False, notify=lambda _: None)
    assert "without a cold start" in result["label"]
    assert result["eval"]["movement"]["parsed"]["count"] == 0
    assert GenerationConfig.from_pretrained(tmp_path / "run" / "model").use_cache


def test_a_chat_model_gets_the_real_prompt(model: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(model, tmp_path / "chat")
    ModelFolder(label="chat").save(folder)
    template = "{% for message in messages %}{{ message.content }}\n{% endfor %}"
    (folder / "chat_template.jinja").write_text(template)
    wanted = config(folder, "steps=1", "save_every=1", "prompts=1", "max_tokens=4")
    result = train_grpo(wanted, tmp_path / "run", resume=False, notify=lambda _: None)
    assert result["eval"]["movement"]["replies"] == 4
    (first, second) = read_training(tmp_path / "run").curves
    assert (second["faults"], second["length"], second["parsed"]) == (0, 4, 0)
    assert first["eval"]["movement"]["mean"] == 0


def test_an_adapter_is_merged_before_a_new_one_is_trained(model: Path, tmp_path: Path) -> None:
    plain, tokenizer = load_base(config(model), ())
    torch.manual_seed(3)
    adapted = get_peft_model(
        plain, LoraConfig(target_modules="all-linear", init_lora_weights=False)
    )
    folder = tmp_path / "adapter"
    adapted.save_pretrained(folder)
    tokenizer.save_pretrained(folder)
    ModelFolder(label="car", prompts="shorthand").save(folder)
    merged, _ = load_base(config(folder), ())
    ids = torch.tensor([[3, 4, 5]])
    assert torch.allclose(merged(ids).logits, adapted(ids).logits, atol=1e-4)
    small = ("steps=1", "save_every=1", "max_tokens=20", "kl=0.1")
    for name, adapter in {"adapter": "{lora: {rank: 2}}", "all weights": "null"}.items():
        wanted = config(folder, *small, f"peft={adapter}")
        train_grpo(wanted, tmp_path / name / "run", resume=False, notify=lambda _: None)
        kl = read_training(tmp_path / name / "run").curves[1]["kl"]
        assert kl == pytest.approx(0, abs=1e-6), f"{name}: the first step is at the start"


def test_a_missing_model_is_named_before_anything_is_written(tmp_path: Path) -> None:
    out = tmp_path / "run"
    words = f"cannot load the model '{tmp_path / 'nowhere'}' .model.name.: it is neither a folder"
    with pytest.raises(ConfigError, match=words):
        train_grpo(config(tmp_path / "nowhere"), out, resume=False, notify=lambda _: None)
    assert not out.exists()
