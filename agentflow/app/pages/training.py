"""Pages of training runs: curves, samples by step with films, diversity by step."""

from __future__ import annotations

import asyncio
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from agentflow.app.pages.films import Shapes
from agentflow.app.pages.runs import COARSE, FINE, ReportedMachine, film_machines
from agentflow.config.run import values_in
from agentflow.env.physics.engine import AUTO
from agentflow.env.physics.engines import usable_engine
from agentflow.env.tasks.registry import get_task
from agentflow.machine import Machine, check, read_machine
from agentflow.machine.brief import Brief
from agentflow.metrics.tables import counted
from agentflow.progress import Progress
from agentflow.report.page import require_writable, write_page
from agentflow.training.evaluation.record import read_replies
from agentflow.training.evaluation.replies import JudgedReply, summarise
from agentflow.training.record import OF_SAMPLES, TrainingRecord, flatten, read_training

CHARTS: tuple[tuple[str, str, tuple[str, ...]], ...] = (
    ("Reward", "per reply", ("reward", "score")),
    ("Greatest score of a step", "score", ("score_max",)),
    ("Replies", "share", ("parsed", "spatial", "valid", "non_zero", "distinct", "cut_off")),
    ("Loss", "per token", ("loss", "dev_loss")),
    ("Accuracy", "share of tokens", ("token_accuracy", "dev_token_accuracy")),
    ("Entropy", "nats per token", ("entropy", "dev_entropy")),
    ("Divergence from the first model", "nats per token", ("kl",)),
    ("Length of replies", "tokens", ("length",)),
    (
        "Seconds per step",
        "s",
        ("seconds_generation", "seconds_simulation", "seconds_update"),
    ),
    ("Time so far", "s", ("seconds",)),
)
"""Title, unit and numbers of each chart, where a run has any of them; other numbers follow."""
EVALUATED: tuple[tuple[str, str, tuple[str, ...]], ...] = (
    ("Best@N of the samples", "score", tuple(f"best_at.{1 << power}" for power in range(11))),
    ("Valid samples", "share", ("parsed.share", "spatial.share", "valid.share")),
    (
        "Diversity: difference of shapes",
        "diagonals of a machine",
        ("diversity.chamfer", "diversity.hausdorff"),
    ),
    (
        "Diversity: similarity (lower is more diverse)",
        "at most 1",
        ("diversity.iou", "diversity.graph_similarity"),
    ),
    ("Diversity: tree edit distance", "blocks", ("diversity.tree_edit_distance",)),
)
"""The same for the numbers of a task's samples."""
FILMED = 3
"""Machines of each task with a film after a step, best first."""
REFUSED = 2
"""Replies without a valid machine that are shown after a step."""
Row = Mapping[str, float]


def training_report(path: Path, out: Path, *, films: int, workers: int, say: Progress) -> Path:
    """Write the page of a training run, finished or not.

    Args:
        path: Training directory.
        out: File to write.
        films: Number of machines with a film, those of the last steps first.
        workers: Worker processes for simulation.
        say: Receives progress.
    """
    run = read_training(path)
    require_writable(out)
    shapes = Shapes()
    shown = _Samples(run)
    chosen = shown.to_film(films)
    machines = asyncio.run(film_machines(chosen, shapes, workers, say))
    rows = [flatten(row) for row in run.curves]
    others = {name: any(row.get(name) for row in rows) for name in _others(rows)}
    single = [(name, "", (name,)) for name, shown in others.items() if shown]
    data = {
        "kind": "training",
        "title": run.path.resolve().name,
        "label": run.about.label,
        "about": _about(run),
        "charts": _charts([*CHARTS, *single], rows),
        "zero": [name for name, shown in others.items() if not shown],
        "tasks": [
            {"task": task, "charts": _charts(EVALUATED, _of_task(rows, task))}
            for task in shown.tasks
        ],
        "steps": shown.to_json(),
        "facts": [[".".join(keys), _setting(value)] for keys, value in values_in(run.config)],
        "machines": machines,
        **shapes.data,
    }
    write_page(out, f"{run.path.resolve().name} · agentflow", data)
    return out


class _Samples:
    """The samples that a run saved, and which of them the page shows."""

    def __init__(self, run: TrainingRecord) -> None:
        engine = usable_engine(str(run.config.get("engine", AUTO)))
        self._steps = {
            (step, task): [reply for reply in replies if reply.task == task]
            for step, path in run.samples.items()
            for replies in [read_replies(path)]
            for task in dict.fromkeys(reply.task for reply in replies)
        }
        self.tasks = tuple(dict.fromkeys(task for _, task in self._steps))
        self._levels = {task: get_task(task, engine=engine) for task in self.tasks}
        self._best = {
            (step, task): _best_machines(replies, self._levels[task].brief)
            for (step, task), replies in self._steps.items()
        }

    def to_film(self, most: int) -> dict[str, ReportedMachine]:
        """Key of a machine -> the machine; those after the last steps first."""
        found: dict[str, ReportedMachine] = {}
        for (_, task), machines in reversed(self._best.items()):
            for rank, (key, (reply, machine)) in enumerate(machines.items()):
                film = (FINE if rank == 0 else COARSE) if len(found) < most else None
                level, score = self._levels[task], reply.score
                found.setdefault(key, ReportedMachine(machine, level, reply.seed, score, film))
        return found

    def to_json(self) -> list[dict[str, Any]]:
        """What the page shows of each step and task."""
        return [
            {
                "step": step,
                "task": task,
                "unit": self._levels[task].unit,
                **_numbers(replies),
                "best": [
                    {"machine": key, "score": reply.score, "text": reply.text}
                    for key, (reply, _) in self._best[step, task].items()
                ],
                "refused": [
                    {"problem": reply.problem, "text": reply.text}
                    for reply in replies
                    if not reply.valid
                ][:REFUSED],
            }
            for (step, task), replies in self._steps.items()
        ]


def _numbers(replies: Sequence[JudgedReply]) -> dict[str, Any]:
    """Counts, scores and interval of a step's replies to a task."""
    found = summarise(replies)
    interval = found.scores.mean_all_interval()
    return {
        "count": found.replies,
        "valid": found.valid.count,
        "faults": found.faults,
        "mean": found.mean,
        "low": interval and interval.low,
        "high": interval and interval.high,
        "values": sorted(found.scores.all),
    }


def _best_machines(
    replies: Iterable[JudgedReply], brief: Brief
) -> dict[str, tuple[JudgedReply, Machine]]:
    """Key -> reply and machine of the best different machines; they must be valid today."""
    found: dict[str, tuple[JudgedReply, Machine]] = {}
    scored = [reply for reply in replies if reply.valid and reply.score is not None]
    for reply in sorted(scored, key=lambda reply: -(reply.score or 0.0)):
        parsed = read_machine(reply.machine, brief.blocks, brief.given)
        machine = check(parsed, brief).machine
        if machine is not None and len(found) < FILMED:
            found.setdefault(f"{reply.task} {reply.seed} {machine.digest}", (reply, machine))
    return found


def _about(run: TrainingRecord) -> str:
    kind = {"sft": "supervised fine-tuning", "grpo": "reinforcement learning (GRPO)"}
    last = run.curves[-1]["step"] if run.curves else 0
    steps = counted(int(last), "step")
    return f"{kind[run.about.kind]}, {steps}{'' if run.result else ', unfinished'}"


def _of_task(rows: Iterable[Row], task: str) -> list[Row]:
    """The numbers of a task's samples, by their own names, and the step."""
    prefix = f"{OF_SAMPLES}{task}."
    return [
        {"step": row["step"]}
        | {key.removeprefix(prefix): value for key, value in row.items() if key.startswith(prefix)}
        for row in rows
    ]


def _others(rows: Sequence[Row]) -> list[str]:
    """Numbers of every step that have no place in `CHARTS`; each has a chart of its own."""
    known = {"step", *(name for _, _, names in CHARTS for name in names)}
    names = dict.fromkeys(name for row in rows for name in row)
    return [name for name in names if name not in known and not name.startswith(OF_SAMPLES)]


def _charts(
    wanted: Sequence[tuple[str, str, tuple[str, ...]]], rows: Sequence[Row]
) -> list[dict[str, Any]]:
    """The charts of numbers that the rows have."""
    names = {name for row in rows for name in row}
    charts = []
    for title, unit, lines in wanted:
        found = [
            {"name": name, "points": [[row["step"], row[name]] for row in rows if name in row]}
            for name in lines
            if name in names
        ]
        if found:
            charts.append({"title": title, "unit": unit, "lines": found})
    return charts


def _setting(value: Any) -> str:
    return ", ".join(map(str, value)) if isinstance(value, list) else str(value)
