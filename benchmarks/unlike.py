"""Whether rewards for unlike mechanisms keep the machines of a trained model varied.

A tiny model learns the smallest throwing machines of the built-in model by heart, some of every
mechanism class, and then from rewards: with and without `advantage.unlike`. Run it with
`.venv-training/bin/python`. It writes a table in docs/results/learning.md. A repeated command
leaves out what is done. `--known`, `--steps`, `--replies` and `--seeds` make it smaller.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from collections import Counter, defaultdict
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import torch
import yaml
from learning import write
from torch.nn.utils.rnn import pad_sequence

from agentflow import design_prompt
from agentflow.env.mechanism import classify
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.registry import get_task
from agentflow.machine import Machine, read_machine
from agentflow.metrics.tables import Column, Row, Table, markdown
from agentflow.models.local.folder import ModelFolder, read_folder, shorten
from agentflow.training.config import TinyModel, read_config
from agentflow.training.data.pairs import TRAIN, read_pairs
from agentflow.training.evaluation.record import read_replies
from agentflow.training.grpo.config import GrpoConfig
from agentflow.training.grpo.train import train_grpo
from agentflow.training.model import make_decoder, train_tokenizer
from agentflow.training.record import TrainingRecord, read_training

TASK = "throwing"
VARIANTS: dict[str, tuple[str, ...]] = {
    "score": (),
    "score + 1 x unlike": ("advantage.unlike=1",),
    "score + 3 x unlike": ("advantage.unlike=3",),
}
"""What is rewarded -> settings."""
BEGIN = "<!-- made by benchmarks/unlike.py: do not edit -->"
COMMAND = "import sys; from agentflow.cli import main; sys.exit(main())"
LEVEL = get_task(TASK, engine="mujoco")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, nargs="?", default=Path("unlike"))
    parser.add_argument("--page", type=Path, default=Path("docs/results/learning.md"))
    parser.add_argument("--known", type=int, default=5, help="machines of a class that it learns")
    parser.add_argument("--steps", type=int, default=60, help="steps of 32 replies")
    parser.add_argument("--replies", type=int, default=64, help="fresh replies that are counted")
    parser.add_argument("--seeds", type=int, default=2, help="trainings of each kind")
    parser.add_argument("--rate", type=float, default=2e-4, help="learning rate of the rewards")
    given = parser.parse_args()
    folder = given.folder
    folder.mkdir(parents=True, exist_ok=True)
    torch.set_num_threads(1)
    if not (folder / "model").exists():
        learn_by_heart(make_data(folder), folder / "model", given.known)
    for seed in range(given.seeds):
        for number, settings in enumerate(VARIANTS.values()):
            size = (f"steps={given.steps}", f"eval_every={given.steps}")
            rate = f"optimiser.learning_rate={given.rate}"
            keys = (*size, f"eval_samples={given.replies}", f"seed={seed}", rate, *settings)
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
    """A tiny model that writes the smallest machines of each class of the data, all with the same
    chance."""
    prompt = shorten(design_prompt(TASK))
    made = (read(json.dumps(pair.machine)) for pair in read_pairs(data / TRAIN))
    kinds: defaultdict[str, list[str]] = defaultdict(list)
    for text in sorted({machine.to_text() for machine in made}, key=lambda text: (len(text), text)):
        if kind := class_of(text):
            kinds[kind].append(prompt + text)
    texts = [text for alike in kinds.values() for text in alike[:known]]
    known_ones = f"{len(texts)} machines of {len(kinds)} mechanism classes"
    tokenizer = train_tokenizer(texts, 512)
    torch.manual_seed(0)
    model = make_decoder(TinyModel(hidden=64, layers=2, heads=4, feed_forward=192), tokenizer)
    batch = tokenizer([text + tokenizer.eos_token for text in texts])["input_ids"]
    memorise(model, [(ids, ids) for ids in batch], 1200, tokenizer.pad_token_id)
    model.save_pretrained(out)
    tokenizer.save_pretrained(out)
    ModelFolder(label=f"tiny model that knows {known_ones}", prompts="shorthand").save(out)


def memorise(
    model: Any, rows: Sequence[tuple[list[int], list[int]]], steps: int, pad: int, size: int = 16
) -> None:
    """Train on rows of tokens and labels, `size` of them at a time; the rate falls to 0."""
    optimiser = torch.optim.Adam(model.parameters(), 4e-3)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps)
    for step in range(steps):
        chosen = [rows[int(index)] for index in torch.randperm(len(rows))[:size]]
        ids, labels = (
            pad_sequence([torch.tensor(row[part]) for row in chosen], True, fill)
            for part, fill in enumerate((pad, -100))
        )
        optimiser.zero_grad()
        loss = model(ids, labels=labels).loss
        loss.backward()
        optimiser.step()
        schedule.step()
        if step % 100 == 0 or step == steps - 1:
            print(f"by heart, step {step}: loss {loss.item():.3f}", flush=True)


def improve(folder: Path, name: str, settings: Sequence[str]) -> None:
    """Train by rewards, unless that is done."""
    keys = ("prompts=2", "workers=1", "max_tokens=320", "threads=1", *settings)
    path = Path("configs/train/grpo_tiny.yaml")
    config = read_config(GrpoConfig, path, keys, {"model.name": str(folder / "model")})
    train_grpo(config, folder / name, True, print)


def table(folder: Path, given: argparse.Namespace) -> Table:
    """Classes and scores of fresh replies before training and after it."""
    rows = []
    for seed in range(given.seeds):
        for number, name in enumerate(VARIANTS):
            record = read_training(folder / f"{number}-{seed}")
            if number == 0:
                rows.append(row_of(record, "before", seed, 0))
            rows.append(row_of(record, name, seed, given.steps))
    names = ("valid", "mean score", "Best@16", "mechanism classes", "largest class", "entropy")
    notes = (
        f"{given.replies} fresh replies each, {given.steps} steps of 32 replies, learning rate "
        f"{given.rate:g}. Classes of machines that score; the largest: its share of these. "
        "Entropy: nats per token in the first or last step.",
    )
    label = read_folder(folder / "model").label
    columns = tuple(Column("", name) for name in names)
    title = f"Rewards for unlike mechanisms: {TASK}, {label}"
    return Table(title, ("seed", "rewards"), columns, tuple(rows), notes=notes)


def row_of(record: TrainingRecord, name: str, seed: int, step: int) -> Row:
    rows = [row for row in record.curves if row["step"] == step and "eval" in row]
    numbers: dict[str, Any] = rows[0]["eval"][TASK]
    entropies = [row["entropy"] for row in record.curves if "entropy" in row]
    replies = read_replies(record.samples[step])
    kinds = Counter(filter(None, (class_of(reply.text) for reply in replies if reply.valid)))
    told = (
        f"{numbers['valid']['count']}/{numbers['replies']}",
        numbers["mean"],
        numbers["best_at"]["16"],
        len(kinds),
        f"{max(kinds.values()) / kinds.total():.0%}" if kinds else None,
        entropies[-1 if step else 0],
    )
    return Row((str(seed), name), told)


@cache
def class_of(source: str) -> str | None:
    """The mechanism class of a machine; None if it does not score."""
    machine = read(source)
    rollout = simulate(machine, LEVEL, seed=0)
    return str(classify(machine, rollout)) if (rollout.score or 0) > 0 else None


def read(source: str) -> Machine:
    machine = read_machine(source, LEVEL.brief.blocks, LEVEL.brief.given).machine
    assert machine is not None
    return machine


if __name__ == "__main__":
    main()
