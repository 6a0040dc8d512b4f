"""Scores replies with verl's managers of rewards; runs in `.venv-training`, downloads nothing.

Usage: python verl_rewards.py CODE OVERRIDES CAR, where CODE writes rows to train.parquet and
OVERRIDES are those of verl's configuration, as a JSON list. Replies are a car and no machine;
then three to one prompt, of which CAR crashes the simulation.
"""

from __future__ import annotations

import asyncio
import json
import sys
from typing import Any

import numpy as np
import ray
import torch
import transfer_queue
from datasets import Dataset
from hydra import compose, initialize_config_module
from tokenizers import Tokenizer, decoders, models, pre_tokenizers
from transformers import PreTrainedTokenizerFast
from verl import DataProto
from verl.experimental.agent_loop.agent_loop import AgentLoopMetrics, AgentLoopOutput
from verl.experimental.reward_loop.reward_loop import (
    RewardLoopManager,
    migrate_legacy_reward_impl,
)
from verl.trainer.ppo.reward import load_reward_manager
from verl.trainer.ppo.v1.agent_loop_tq import AgentLoopWorkerTQ
from verl.trainer.ppo.v1.replay_buffer import ReplayBuffer
from verl.workers.reward_manager import BatchRewardManager, NaiveRewardManager

import agentflow
from agentflow.errors import NoScoreError
from agentflow.integrations.verl import compute_score, compute_scores

PAD = "<pad>"


def byte_tokenizer() -> PreTrainedTokenizerFast:
    """A tokenizer whose tokens are bytes."""
    alphabet = sorted(pre_tokenizers.ByteLevel.alphabet())
    tokens = {token: number for number, token in enumerate([PAD, *alphabet])}
    tokenizer = Tokenizer(models.BPE(tokens, []))
    tokenizer.pre_tokenizer = pre_tokenizers.ByteLevel(add_prefix_space=False)
    tokenizer.decoder = decoders.ByteLevel()
    return PreTrainedTokenizerFast(tokenizer_object=tokenizer, eos_token=PAD, pad_token=PAD)


def batch_of(
    tokenizer: PreTrainedTokenizerFast, rows: list[dict[str, Any]], replies: list[str]
) -> DataProto:
    """Rows with a reply each, as verl's rollouts leave them: padded tokens, and columns."""
    ids = [tokenizer(reply)["input_ids"] for reply in replies]
    length = max(map(len, ids))
    responses = torch.tensor([[*row, *[0] * (length - len(row))] for row in ids])
    prompts = torch.ones(len(ids), 1, dtype=torch.long)
    written = [[1] * (1 + len(row)) + [0] * (length - len(row)) for row in ids]
    tensors = {"prompts": prompts, "responses": responses, "attention_mask": torch.tensor(written)}
    columns = {
        name: np.array([row[name] for row in rows], dtype=object)
        for name in ("data_source", "reward_model", "extra_info")
    }
    return DataProto.from_dict(tensors, non_tensors=columns)


def last_rewards(tensor: torch.Tensor, batch: DataProto) -> list[float]:
    """The rewards at the last tokens, which must be the only ones."""
    ends = batch.batch["attention_mask"].sum(dim=1) - 2
    assert torch.count_nonzero(tensor).item() <= len(ends)
    return [float(row[end]) for row, end in zip(tensor, ends, strict=True)]


class GivenReplies(AgentLoopWorkerTQ.__ray_metadata__.modified_class):  # type: ignore[misc]
    """verl's worker that rolls out and scores the replies to a prompt; these replies are given."""

    def __init__(self, config: Any, tokenizer: Any, scorers: Any, replies: list[str]) -> None:
        self.config, self.tokenizer, self.replies = config, tokenizer, replies
        self.reward_loop_worker_handles = scorers
        self.processor, self.distillation_enabled, self.mm_processor_kwargs = None, False, {}

    async def _run_agent_loop(self, _: Any, *, session_id: int, **row: Any) -> None:
        ids = self.tokenizer(self.replies[session_id])["input_ids"]
        output = AgentLoopOutput(
            prompt_ids=[1],
            response_ids=ids,
            response_mask=[1] * len(ids),
            metrics=AgentLoopMetrics(),
        )
        del row["trajectory"]
        await self._agent_loop_postprocess(output, False, session_id=session_id, **row)


def learned_from(worker: GivenReplies, row: dict[str, Any]) -> dict[str, float]:
    """The replies to one prompt that verl's default trainer learns from, with their rewards."""
    transfer_queue.init()
    asked = {"is_prompt": True, "status": "pending", "global_steps": 1}
    prompt = {**row, "uid": "row", "global_steps": 1, "raw_prompt": row["prompt"], "index": 0}

    async def roll_out() -> None:
        await transfer_queue.async_kv_put(key="row", partition_id="train", tag=asked)
        await worker._run_prompt(prompt, {}, {"validate": False})

    asyncio.run(roll_out())
    settings = worker.config.trainer.v1.sync
    buffer = ReplayBuffer("sync", settings, None, "drop", {}, poll_interval=0.1)
    keys = sorted(buffer.sample(1, "train", 1)[0].keys)
    columns = transfer_queue.kv_batch_get(keys=keys, partition_id="train")
    return {key: float(row.sum()) for key, row in zip(keys, columns["rm_scores"], strict=True)}


def fault_of(call: Any) -> str:
    """The message of the error that says that there is no score."""
    try:
        call()
    except NoScoreError as error:
        return str(error)
    raise AssertionError("no error")


def main(code: str, overrides: str, car: str) -> None:
    exec(code, {})
    tokenizer = byte_tokenizer()
    tokenizer.save_pretrained("tokenizer")
    rows = [Dataset.from_parquet("train.parquet")[0]] * 2
    data = batch_of(tokenizer, rows, [car, "no machine"])
    crash = {**rows[0], "reward_model": {"ground_truth": "faulty/2"}}
    crashing = batch_of(tokenizer, [crash], [car])

    with initialize_config_module("verl.trainer.config", version_base=None):
        config = migrate_legacy_reward_impl(compose("ppo_trainer", overrides=json.loads(overrides)))
    config.actor_rollout_ref.model.path = "tokenizer"
    config.reward.num_workers = 2

    single = load_reward_manager(config, tokenizer)
    naive = NaiveRewardManager(tokenizer, 0, compute_score)
    batch = BatchRewardManager(tokenizer, 0, compute_scores)
    run = asyncio.get_event_loop().run_until_complete
    extra = rows[0]["extra_info"]
    found: dict[str, Any] = {
        "score": agentflow.reward("movement", car, knobs=json.loads(extra["knobs"])).value,
        "single": [run(single.run_single(data[row : row + 1])) for row in (0, 1)],
        "naive": last_rewards(naive(data), data),
        "batch": last_rewards(batch(data), data),
        "faults": [
            fault_of(lambda: run(single.run_single(crashing))),
            fault_of(lambda: naive(crashing)),
            fault_of(lambda: batch(crashing)),
        ],
    }
    ray.init("local", num_cpus=4, include_dashboard=False, log_to_driver=False)
    loop = RewardLoopManager(config)
    scored = loop.compute_rm_score(data)
    found["loop"] = last_rewards(scored.batch["rm_scores"], data)
    found["valid"] = scored.non_tensor_batch["valid"].tolist()
    found["faults"].append(fault_of(lambda: loop.compute_rm_score(crashing)))
    three_wheels = json.dumps(json.loads(car)[:-1])
    replies = [three_wheels, car, "no machine"]
    config.actor_rollout_ref.rollout.n = len(replies)
    worker = GivenReplies(config, tokenizer, loop.reward_loop_worker_handles, replies)
    found["learned"] = learned_from(worker, crash)
    found["expected"] = compute_score("", three_wheels, "faulty/2", crash["extra_info"])["score"]
    ray.shutdown()
    print(f"\n{json.dumps(found)}")


if __name__ == "__main__":
    main(*sys.argv[1:])
