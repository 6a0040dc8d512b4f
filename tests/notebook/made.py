"""Sweeps for tests, made of the recorded run with other scores, which costs no simulation."""

from __future__ import annotations

import json
import random
import shutil
from pathlib import Path
from typing import Any

from agentflow.app.sweeps.folder import RUNS, _write_new, sweep_document
from agentflow.config.sweep import list_runs, read_sweep
from agentflow.runs.reading import document_text, read_document

RECORDED = Path(__file__).parents[2] / "runs" / "recorded-throwing"


def made_sweep(
    folder: Path,
    *,
    tasks: tuple[str, ...] = ("throwing",),
    variants: tuple[str, ...] = ("mcts", "random"),
    seeds: int = 3,
) -> Path:
    """A finished sweep; later variants score higher, and each seed differs."""
    content = {
        "title": "made",
        "base": {"engine": "mujoco"},
        "seeds": [*range(seeds)],
        "axes": {
            "task": {name: {"task": name} for name in tasks},
            "search": {name: {"search.strategy": name} for name in variants},
        },
        "table": {"metrics": ["mean"]},
    }
    sweep = read_sweep(content, "made")
    (folder / RUNS).mkdir(parents=True)
    _write_new(folder / "sweep.yaml", sweep_document("made", sweep))
    for number, run in enumerate(list_runs(sweep)):
        path = shutil.copytree(RECORDED, folder / RUNS / run.name)
        document = read_document(path)
        document["config"] |= {"task": run.config.task, "seed": run.config.seed}
        document["config"]["settings"]["search"]["strategy"] = run.config.settings.search.strategy
        (path / "run.yaml").write_text(document_text(document))
        factor = 1 + 0.3 * variants.index(run.labels["search"])
        factor *= random.Random(number).uniform(0.8, 1.2)
        for name in ("events.jsonl", "result.json"):
            lines = (path / name).read_text().splitlines() if name.endswith("l") else None
            items = [json.loads(line) for line in lines or [(path / name).read_text()]]
            text = "\n".join(json.dumps(_scaled(item, factor)) for item in items)
            (path / name).write_text(text + "\n")
    return folder


def _scaled(item: Any, factor: float) -> Any:
    """JSON data with every score multiplied."""
    if isinstance(item, dict):
        return {
            key: value * factor
            if key in ("score", "low", "high", "max", "mean") and isinstance(value, float)
            else _scaled(value, factor)
            for key, value in item.items()
        }
    return [_scaled(part, factor) for part in item] if isinstance(item, list) else item
