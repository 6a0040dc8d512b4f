"""Whether the reward of a tiny model rises when it trains with tools (`train grpo --tools`).

A cold start comes first: the model learns transcripts by heart in which small throwing machines of
the built-in model are checked and submitted at a bench, some after a check that was refused. Run it
with `.venv-training/bin/python`. It writes tables in docs/results/learning.md. A repeated command
leaves out what is done.
"""

from __future__ import annotations

import argparse
import json
import random
import re
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from statistics import fmean
from typing import Any

import numpy as np
import torch
from learning import write
from tokenizers import AddedToken
from trl.chat_template_utils import qwen3_chat_template
from unlike import LEVEL, TASK, make_data, memorise, read

from agentflow.agents.base import chat_prompt
from agentflow.agents.designer import Designer
from agentflow.agents.tool_agent import Agent
from agentflow.integrations.trl import BenchTools, bench_environment
from agentflow.metrics.tables import Column, Row, Table, markdown
from agentflow.models.local.folder import ModelFolder, read_folder
from agentflow.tools.bench import TOOLS
from agentflow.training.config import TinyModel, read_config
from agentflow.training.data.pairs import TRAIN, read_pairs
from agentflow.training.grpo.config import GrpoConfig
from agentflow.training.grpo.train import train_grpo
from agentflow.training.model import make_decoder, train_tokenizer
from agentflow.training.record import read_training

BEGIN = "<!-- made by benchmarks/calling.py: do not edit -->"
END, START = "<|im_end|>", "<|im_start|>"
NAME = re.compile(r"\b[0-9a-f]{8}\b")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, nargs="?", default=Path("calling"))
    parser.add_argument("--page", type=Path, default=Path("docs/results/learning.md"))
    parser.add_argument("--known", type=int, default=16, help="machines of the transcripts")
    parser.add_argument("--learn", type=int, default=1500, help="steps of the cold start")
    parser.add_argument("--steps", type=int, default=60, help="steps of 32 designs")
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--rate", type=float, default=2e-4, help="learning rate of the rewards")
    given = parser.parse_args()
    folder = given.folder
    folder.mkdir(parents=True, exist_ok=True)
    torch.set_num_threads(1)
    environment = partial(bench_environment, scored=False)
    if not (folder / "model").exists():
        begin_cold(make_data(folder), folder / "model", given)
    for seed in range(given.seeds):
        keys = (
            *(f"steps={given.steps}", f"eval_every={given.steps}", f"seed={seed}", "rollouts=2"),
            *("prompts=2", "max_tokens=320", "eval_samples=1", "workers=1", "threads=1"),
            f"optimiser.learning_rate={given.rate}",
        )
        fixed = {"model.name": str(folder / "model"), "tools": True}
        config = read_config(GrpoConfig, Path("configs/train/grpo_tiny.yaml"), keys, fixed)
        train_grpo(config, folder / str(seed), True, print, environment=environment)
    parts = map(markdown, tables(folder, given))
    write(given.page, "\n".join(parts), BEGIN)


def begin_cold(data: Path, out: Path, given: argparse.Namespace) -> None:
    """A tiny model that has learnt how machines are checked and submitted."""
    made = {read(json.dumps(pair.machine)).to_text() for pair in read_pairs(data / TRAIN)}
    smallest = sorted(made, key=lambda text: (len(text), text))[: given.known]
    bench = bench_environment(2, engine="mujoco", workers=1)()
    chance = random.Random(0)
    transcripts = []
    for number, text in enumerate(smallest):
        machine = json.loads(text)
        transcripts.append(converse(bench, [machine]))
        if number % 4 == 3:
            transcripts.append(converse(bench, [spoil(bench, machine, chance), machine]))
    messages = [chat_prompt(role, LEVEL.brief) for role in (Agent, Designer)]
    said = "".join(text for transcript in transcripts for _, text in transcript)
    tokenizer = train_tokenizer(re.split(r"<\|im_\w+\|>", said), 512)  # no token holds these marks
    tokenizer.add_special_tokens({"eos_token": END, "additional_special_tokens": [START]})
    tokenizer.chat_template = qwen3_chat_template
    names = sorted(tool.spec.name for tool in TOOLS if tool.needs != "pictures")  # as TRL sorts
    tools = [getattr(bench, name) for name in names]
    # Each long text that never changes is a single token: a tiny model cannot read it.
    fixed = tokenizer.apply_chat_template(messages[0][:1], tools=tools, tokenize=False)
    texts = [message["content"] for prompt in messages for message in prompt]
    texts += [line for line in fixed.split("\n") if len(line) > 20 and END not in line]
    tokenizer.add_tokens([AddedToken(text, normalized=False) for text in texts])
    *first, last = messages[0]
    asked = [*first, last | {"content": last["content"] + bench.reset(TASK)}]
    prompt = tokenizer.apply_chat_template(
        asked, tools=tools, add_generation_prompt=True, tokenize=False
    )
    length = len(tokenizer(prompt)["input_ids"])
    print(f"{len(transcripts)} transcripts; a prompt has {length} tokens", flush=True)
    torch.manual_seed(0)
    size = TinyModel(hidden=64, layers=2, heads=4, feed_forward=192, positions=16384)
    model = make_decoder(size, tokenizer)
    model.generation_config.eos_token_id = model.config.eos_token_id = tokenizer.eos_token_id
    rows = [tokens_of(tokenizer, [(False, prompt), *one]) for one in transcripts]
    memorise(model, rows, given.learn, tokenizer.pad_token_id, size=8)
    bench.session.close()
    model.save_pretrained(out)
    tokenizer.save_pretrained(out)
    label = f"tiny model that knows {len(transcripts)} transcripts"
    ModelFolder(label=label, prompts="chat").save(out)


def converse(bench: BenchTools, machines: Sequence[Any]) -> list[tuple[bool, str]]:
    """What is said in a design that checks these machines and submits the last.

    Returns:
        Texts, and whether the model learns to say them.
    """
    bench.reset(TASK)
    said, told = [], ""
    for machine in machines:
        arguments = {"machine": json.dumps(machine)}
        told = bench.check(**arguments)
        said += [(machine is machines[-1], call("check", arguments)), (False, answer(told))]
    arguments = {"machine": NAME.search(told)[0]}
    told = bench.submit(**arguments)
    said += [(True, call("submit", arguments)), (False, answer(told)), (True, f"Done.{END}")]
    return said


def call(tool: str, arguments: dict[str, str]) -> str:
    asked = json.dumps({"name": tool, "arguments": arguments})
    return f"<tool_call>\n{asked}\n</tool_call>{END}"


def answer(text: str) -> str:
    """The answer of a tool as the chat template writes it."""
    turn = f"{START}user\n<tool_response>\n{text}\n</tool_response>{END}"
    return f"\n{turn}\n{START}assistant\n"


def spoil(bench: BenchTools, machine: Sequence[Any], chance: random.Random) -> list[Any]:
    """The machine with one face changed so that the bench refuses it."""
    bench.reset(TASK)
    while True:
        steps = [dict(step) for step in machine]
        step = chance.choice([step for step in steps[1:] if "face_id" in step])
        step["face_id"] = chance.randrange(10)
        if not NAME.search(bench.check(machine=json.dumps(steps))):
            return steps


def tokens_of(tokenizer: Any, parts: Sequence[tuple[bool, str]]) -> tuple[list[int], list[int]]:
    """Tokens, and labels where the model learns to say them."""
    ids: list[int] = []
    labels: list[int] = []
    for learned, text in parts:
        found = tokenizer(text)["input_ids"]
        ids += found
        labels += found if learned else [-100] * len(found)
    return ids, labels


def tables(folder: Path, given: argparse.Namespace) -> Iterator[Table]:
    """Rewards of tenths of the training, and whether they rose."""
    curves = [
        [row for row in read_training(folder / str(seed)).curves if "reward" in row]
        for seed in range(given.seeds)
    ]
    names = ("reward", "score", "valid")
    columns = tuple(Column(f"seed {seed}", name) for seed in range(given.seeds) for name in names)
    part = max(1, given.steps // 10)
    rows = []
    for first in range(0, given.steps, part):
        of = [curve[first : first + part] for curve in curves]
        means = tuple(fmean(row[name] for row in some) for some in of for name in names)
        rows.append(Row((f"{first + 1} to {first + len(of[0])}",), means))
    title = f"Training with tools: {TASK}, {read_folder(folder / 'model').label}"
    notes = (
        f"32 designs a step, learning rate {given.rate:g}. valid: share that submitted a machine. "
        "Score: mean of all designs, m; reward: that of the tiny preset.",
    )
    yield Table(title, ("steps",), columns, tuple(rows), notes=notes)
    third = given.steps // 3
    rows = []
    for name in ("reward", "score"):
        numbers = np.array([[row[name] for row in curve] for curve in curves])
        groups = {str(seed): numbers[[seed]] for seed in range(given.seeds)} | {"all": numbers}
        for label, members in groups.items():
            first, last = members[:, :third].ravel(), members[:, -third:].ravel()
            low, high = interval(first, last)
            rise = last.mean() - first.mean()
            told = (first.mean(), last.mean(), rise, f"{low:.2f} to {high:.2f}")
            rows.append(Row((name, label), told))
    columns = tuple(Column("", name) for name in ("first third", "last third", "rise", "95 %"))
    notes = (f"Means of {third} steps each; intervals: 10,000 bootstrap resamples of the steps.",)
    title = "Reward and score in the first and last third"
    yield Table(title, ("of", "seed"), columns, tuple(rows), notes=notes)


def interval(first: Any, last: Any) -> tuple[float, float]:
    """95 % interval of the difference of two means, over resampled steps."""
    rng = np.random.default_rng(0)
    means = [rng.choice(part, (10_000, len(part))).mean(axis=1) for part in (first, last)]
    low, high = np.percentile(means[1] - means[0], (2.5, 97.5))
    return float(low), float(high)


if __name__ == "__main__":
    main()
