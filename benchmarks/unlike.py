"""Whether rewards for unlike mechanisms keep the machines of a trained model varied.

A tiny model learns small throwing machines of the built-in model by heart, and then from rewards:
with and without `advantage.unlike`, with two seeds. Run it with `.venv-training/bin/python`. It
writes a table in docs/results/learning.md. A repeated command leaves out what is done. A step with
its simulations took 9 to 10 s on two cores with much else to do; `--known`, `--steps` and
`--replies` make it smaller.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import torch
import yaml
from learning import write

from agentflow import design_prompt
from agentflow.env.mechanism import classify
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.registry import get_task
from agentflow.machine import Machine, read_machine
from agentflow.metrics.tables import Column, Row, Table, markdown
from agentflow.models.local.folder import ModelFolder
from agentflow.models.local.shorthand import shorten
from agentflow.training.config import TinyModel, read_config
from agentflow.training.data.pairs import TRAIN, read_pairs
from agentflow.training.evaluation.record import read_replies
from agentflow.training.grpo.config import GrpoConfig
from agentflow.training.grpo.train import train_grpo
from agentflow.training.model import make_decoder, train_tokenizer
from agentflow.training.record import TrainingRecord, read_training

TASK, SEEDS = "throwing", (0, 1)
VARIANTS = {"score": (), "score and unlike": ("advantage.unlike=1",)}
"""What is rewarded -> settings."""
BEGIN = "<!-- made by benchmarks/unlike.py: do not edit -->"
COMMAND = "import sys; from agentflow.cli import main; sys.exit(main())"
LEVEL = get_task(TASK, engine="mujoco")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, nargs="?", default=Path("unlike"))
    parser.add_argument("--page", type=Path, default=Path("docs/results/learning.md"))
    parser.add_argument("--known", type=int, default=24, help="machines learned by heart")
    parser.add_argument("--steps", type=int, default=20, help="steps of 16 replies")
    parser.add_argument("--replies", type=int, default=64, help="fresh replies that are counted")
    given = parser.parse_args()
    folder = given.folder
    folder.mkdir(parents=True, exist_ok=True)
    torch.set_num_threads(1)
    if not (folder / "model").exists():
        learn_by_heart(make_data(folder), folder / "model", given.known)
    for seed in SEEDS:
        for number, settings in enumerate(VARIANTS.values()):
            size = (f"steps={given.steps}", f"eval_every={given.steps}")
            keys = (*size, f"eval_samples={given.replies}", f"seed={seed}", *settings)
            improve(folder, f"{number}-{seed}", keys)
    write(given.page, markdown(table(folder, given)), BEGIN)


def make_data(folder: Path) -> Path:
    """Machines of the objectives that have the same short prompt as the task, filtered."""
    source, answers, data = (folder / name for name in ("objectives.yaml", "answers", "set"))
    blocks = sorted(map(int, shorten(design_prompt(TASK)).partition("<")[0].split()[1:]))
    wanted = yaml.safe_load(Path("configs/objectives.yaml").read_text(encoding="utf-8"))
    alike = [one for one in wanted if one["scene"]["level"] == TASK and one["blocks"] == blocks]
    source.write_text(yaml.safe_dump(alike, sort_keys=False), encoding="utf-8")
    for command in (
        ("generate", source, "--samples", "40", "--out", answers),
        ("filter", answers, "--out", data, "--engine", "mujoco"),
    ):
        if not (data / "card.json").exists():
            words = [sys.executable, "-c", COMMAND, "data", *map(str, command)]
            subprocess.run([*words, "--workers", "1"], check=True)
    return data


def learn_by_heart(data: Path, out: Path, known: int) -> None:
    """A tiny model that writes the smallest machines of the data, all with the same chance."""
    prompt = shorten(design_prompt(TASK))
    made = (read(json.dumps(pair.machine)) for pair in read_pairs(data / TRAIN))
    smallest = sorted({machine.to_text() for machine in made}, key=lambda text: (len(text), text))
    texts = [prompt + text for text in smallest[:known]]
    tokenizer = train_tokenizer(texts, 512)
    torch.manual_seed(0)
    model = make_decoder(TinyModel(hidden=64, layers=2, heads=4, feed_forward=192), tokenizer)
    batch = tokenizer([text + tokenizer.eos_token for text in texts], padding=True)
    ids, seen = (torch.tensor(batch[key]) for key in ("input_ids", "attention_mask"))
    labels = ids.masked_fill(seen == 0, -100)
    optimiser = torch.optim.Adam(model.parameters(), 5e-3)
    for step in range(300):
        optimiser.zero_grad()
        loss = model(ids, attention_mask=seen, labels=labels).loss
        loss.backward()
        optimiser.step()
        if step % 50 == 0:
            print(f"by heart, step {step}: loss {loss.item():.3f}", flush=True)
    model.save_pretrained(out)
    tokenizer.save_pretrained(out)
    ModelFolder(label=f"tiny model that knows {known} machines", prompts="shorthand").save(out)


def improve(folder: Path, name: str, settings: Sequence[str]) -> None:
    """Train by rewards, unless that is done."""
    keys = ("prompts=1", "device_batch=16", "workers=1", "max_tokens=320", "threads=1", *settings)
    path = Path("configs/train/grpo_tiny.yaml")
    config = read_config(GrpoConfig, path, keys, {"model.name": str(folder / "model")})
    train_grpo(config, folder / name, True, print)


def table(folder: Path, given: argparse.Namespace) -> Table:
    """Classes and scores of fresh replies before training and after it."""
    rows = []
    for seed in SEEDS:
        for number, name in enumerate(VARIANTS):
            record = read_training(folder / f"{number}-{seed}")
            if number == 0:
                rows.append(row_of(record, "before", seed, 0))
            rows.append(row_of(record, name, seed, given.steps))
    names = ("valid", "mean score", "Best@16", "mechanism classes", "entropy per token")
    notes = (
        f"{given.replies} fresh replies each, {given.steps} steps of 16 replies; classes of "
        "machines that score. Entropy: of the first or last step, in nats. Unlike: a weight of 1.",
    )
    known = f"a tiny model that knows {given.known} machines"
    title = f"Rewards for unlike mechanisms: {TASK}, {known}"
    columns = tuple(Column("", name) for name in names)
    return Table(title, ("seed", "rewards"), columns, tuple(rows), notes=notes)


def row_of(record: TrainingRecord, name: str, seed: int, step: int) -> Row:
    rows = [row for row in record.curves if row["step"] == step and "eval" in row]
    numbers: dict[str, Any] = rows[0]["eval"][TASK]
    entropies = [row["entropy"] for row in record.curves if "entropy" in row]
    told = (
        f"{numbers['valid']['count']}/{numbers['replies']}",
        numbers["mean"],
        numbers["best_at"]["16"],
        len(classes(record.samples[step])),
        entropies[-1 if step else 0],
    )
    return Row((str(seed), name), told)


def classes(file: Path) -> set[str]:
    """The mechanism classes of the machines in replies that score."""
    texts = {reply.text for reply in read_replies(file) if reply.valid and (reply.score or 0) > 0}
    machines = map(read, sorted(texts))
    return {str(classify(machine, simulate(machine, LEVEL, seed=0))) for machine in machines}


def read(source: str) -> Machine:
    machine = read_machine(source, LEVEL.brief.blocks, LEVEL.brief.given).machine
    assert machine is not None
    return machine


if __name__ == "__main__":
    main()
