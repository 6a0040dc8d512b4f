"""Trains a tiny model of random weights with TRL; runs in `.venv-training`, downloads nothing.

Usage: python trl_training.py CODE CAR TOOLS, where CODE trains the model in the folder `tiny`. It
is run on the CPU with short completions. Then the model learns from four given replies to a task
whose simulation crashes for one of them, CAR. TOOLS trains it with tools, which it does not call;
then they are called as TRL does.
"""

from __future__ import annotations

import json
import sys
from typing import Any

import torch
import trl
from datasets import Dataset
from tokenizers import Tokenizer, decoders, models, pre_tokenizers, trainers
from transformers import LlamaConfig, LlamaForCausalLM, PreTrainedTokenizerFast
from trl.chat_template_utils import qwen3_chat_template

import agentflow
from agentflow.integrations.trl import bench_environment, simulation_reward

END = "<end>"
TEMPLATE = "{% for message in messages %}{{ message.content }}\n{% endfor %}"
NAME = "6c45a9a7"
"""What the tools call the car."""
SHORT = 16
"""Tokens of a reply."""


def write_model(folder: str, texts: list[str]) -> PreTrainedTokenizerFast:
    """A model whose tokens are the most common pieces of these texts."""
    tokenizer = Tokenizer(models.BPE())
    tokenizer.pre_tokenizer = pre_tokenizers.ByteLevel(add_prefix_space=False)
    tokenizer.decoder = decoders.ByteLevel()
    alphabet = pre_tokenizers.ByteLevel.alphabet()
    trainer = trainers.BpeTrainer(
        vocab_size=1000, special_tokens=[END], initial_alphabet=alphabet, show_progress=False
    )
    tokenizer.train_from_iterator(texts, trainer)
    saved = PreTrainedTokenizerFast(tokenizer_object=tokenizer, eos_token=END, pad_token=END)
    saved.chat_template = TEMPLATE
    saved.save_pretrained(folder)
    torch.manual_seed(0)
    config = LlamaConfig(
        vocab_size=len(saved),
        hidden_size=16,
        intermediate_size=32,
        num_hidden_layers=1,
        num_attention_heads=2,
        max_position_embeddings=16384,
        bos_token_id=None,
        eos_token_id=saved.eos_token_id,
        pad_token_id=saved.pad_token_id,
    )
    LlamaForCausalLM(config).save_pretrained(folder)
    return saved


class TinyConfig(trl.GRPOConfig):
    """The documented arguments, for a model that cannot design and a computer without a GPU."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        small = {"max_completion_length": SHORT, "use_cpu": True, "report_to": []}
        super().__init__(*arguments, **{**options, **small})


def learn(tokenizer: PreTrainedTokenizerFast, task: str, replies: list[str]) -> trl.GRPOTrainer:
    """One step of training with these replies to a task."""
    prompt = [{"role": "user", "content": "Design a machine."}]

    def answer(prompts: list[Any], _: trl.GRPOTrainer) -> dict[str, Any]:
        asked = [tokenizer("Design a machine.")["input_ids"]] * len(prompts)
        replied = [tokenizer(reply)["input_ids"] for reply in replies]
        return {"prompt_ids": asked, "completion_ids": replied, "logprobs": None}

    trainer = trl.GRPOTrainer(
        model="tiny",
        reward_funcs=simulation_reward,
        args=TinyConfig(
            "taught",
            max_steps=1,
            logging_steps=1,
            num_generations=len(replies),
            per_device_train_batch_size=len(replies),
        ),
        train_dataset=Dataset.from_list([{"prompt": prompt, "task": task}]),
        rollout_func=answer,
    )
    trainer.train()
    return trainer


def design(task: str, car: str) -> float | None:
    """The reward of a design with tools."""
    environment: Any = bench_environment(rollouts=3, workers=1)()
    environment.reset(prompt=[], task=task)
    checked = environment.check(machine=car)
    assert NAME in checked
    environment.submit(machine=NAME)
    return environment.get_reward()


def main(code: str, car: str, tools: str) -> None:
    prompts = [message["content"] for message in agentflow.design_prompt("movement")]
    tokenizer = write_model("tiny", [*prompts, car])
    trl.GRPOConfig, documented = TinyConfig, {}
    exec(code, documented)
    trained = documented["trainer"]
    three_wheels = json.dumps(json.loads(car)[:-1])
    taught = learn(tokenizer, "faulty/2", [three_wheels, car, "no machine", three_wheels])
    score = agentflow.reward("faulty/2", three_wheels).value
    tokenizer.chat_template = qwen3_chat_template
    tokenizer.save_pretrained("tiny")
    exec(tools, documented)
    found = {
        "with_tools": documented["trainer"].state.log_history,
        "designed": [design("movement", car), design("faulty/2", car)],
        "trained": trained.state.log_history,
        "taught": taught.state.log_history,
        "rewards": list(taught._logs["rewards"]["simulation_reward"]),
        "advantages": list(taught._logs["advantages"]),
        "score": score,
    }
    print(f"\n{json.dumps(found)}")


if __name__ == "__main__":
    main(*sys.argv[1:])
