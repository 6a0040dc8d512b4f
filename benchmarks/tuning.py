"""Does tuning by CMA-ES find better numbers than random search does? For docs/results/search.md.

Each run begins with a record whose numbers are displaced by up to a fifth of the width of their
bounds (of controllers, a twentieth), the same for every source of numbers, and simulates the same
number of machines, or fewer where one has the greatest score. It can be
interrupted and continued: finished runs are kept in the file of --runs.
"""

from __future__ import annotations

import argparse
import asyncio
import json
from collections.abc import Sequence
from pathlib import Path
from statistics import fmean
from typing import Any

import numpy as np
from budget import PAGE, mean_text
from learning import write

from agentflow.app.tasks import find_task
from agentflow.env.pool.pool import RolloutPool
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.records import record_machine, record_of
from agentflow.machine.numbers import machine_numbers, with_numbers
from agentflow.machine.tree import Machine
from agentflow.metrics.tables import Column, Row, Table, markdown
from agentflow.search.tuning import STEP, Cma, tune

BEGIN = "<!-- made by benchmarks/tuning.py: do not edit -->"
TASKS = ("transport", "transport/2", "rocket/6")
DISPLACED, DISPLACED_LAWS = 0.2, 0.05
"""Greatest displacement of a number, as a share of the width of its bounds: of control programs,
and of controllers, whose bounds are those of the search and wide."""


class Uniform(Cma):
    """Random search: every value anywhere between its bounds."""

    size = 8

    def __init__(self, numbers: Sequence[Any], seed: int) -> None:
        super().__init__(numbers, seed)
        self.rng, self.best = np.random.default_rng(seed), (-np.inf, self._search.x0)

    def ask(self) -> list[list[float]]:
        self._asked = [self.draw() for _ in range(self.size)]
        return [(self._low + self._width * item).tolist() for item in self._asked]

    def draw(self) -> Any:
        return self.rng.random(len(self._low))

    def tell(self, scores: Sequence[float | None]) -> None:
        for score, item in zip(scores, self._asked, strict=True):
            if score is not None and score > self.best[0]:
                self.best = (score, item)

    @property
    def ended(self) -> bool:
        return False


class Steps(Uniform):
    """Random steps from the best so far, as long as the first ones of CMA-ES."""

    def draw(self) -> Any:
        return self.rng.normal(self.best[1], STEP).clip(0, 1)


SOURCES = {"CMA-ES": Cma, "random steps from the best": Steps, "random values": Uniform}


def displaced(machine: Machine, window: float, seed: int) -> Machine:
    """The machine with each of its numbers displaced, within bounds; displacements that do not fit
    together are drawn again."""
    rng, made = np.random.default_rng(seed), None
    numbers = machine_numbers(machine, window)
    source, most = Cma(numbers, seed), DISPLACED_LAWS if machine.controllers else DISPLACED
    low, width = source._low, source._width
    while made is None:
        values = [n.value for n in numbers] + rng.uniform(-most, most, len(numbers)) * width
        made = with_numbers(machine, values.clip(low, low + width).tolist(), window)
    return made


async def run(task: Task, source: str, seed: int, most: int, pool: RolloutPool) -> dict[str, Any]:
    """One run: the score at its start, and the best one."""
    window, record = task.window, record_of(task)
    assert record is not None
    machine = record_machine(record.name)
    assert machine is not None
    start = displaced(machine, window, seed)
    first = await pool.run(start, task)

    async def judge(machines: Sequence[Machine], _generation: int) -> list[float | None]:
        return [r.score for r in await asyncio.gather(*(pool.run(m, task) for m in machines))]

    _, best = await tune(
        SOURCES[source](machine_numbers(start, window), seed),
        lambda values: with_numbers(start, values, window),
        judge,
        start,
        first.score,
        most - 1,
        task.brief.greatest,
    )
    return {"task": task.name, "source": source, "seed": seed, "first": first.score, "best": best}


async def measure(options: argparse.Namespace) -> list[dict[str, Any]]:
    """All runs; those of the file are not made again."""
    file: Path = options.runs
    done = [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []
    known = {(item["task"], item["source"], item["seed"]) for item in done}
    async with RolloutPool(options.workers) as pool:
        for name in options.tasks:
            task = find_task(name, (), options.engine)
            for seed in range(options.seeds):
                for source in SOURCES:
                    if (task.name, source, seed) in known:
                        continue
                    done.append(await run(task, source, seed, options.simulations, pool))
                    with file.open("a") as lines:
                        lines.write(json.dumps(done[-1]) + "\n")
                    print(done[-1], flush=True)
    return done


def table(runs: Sequence[dict[str, Any]], simulations: int) -> Table:
    """Means over seeds, and how CMA-ES differs from each other source."""
    rows = []
    for task in dict.fromkeys(item["task"] for item in runs):
        of = {
            source: {r["seed"]: r for r in runs if (r["task"], r["source"]) == (task, source)}
            for source in SOURCES
        }
        for source, found in of.items():
            ours = of["CMA-ES"]
            apart = [ours[s]["best"] - r["best"] for s, r in found.items() if s in ours]
            won = f"{sum(d > 0 for d in apart)} : {sum(d < 0 for d in apart)}"
            differs = ("", "") if source == "CMA-ES" else (mean_text(apart), won)
            first = f"{fmean(r['first'] for r in found.values()):.1f}"
            best = mean_text([r["best"] for r in found.values()])
            rows.append(Row((task, source), (len(found), first, best, *differs)))
    return Table(
        f"Tuning with {simulations} simulations",
        ("task", "source of numbers"),
        (
            *(Column("", name) for name in ("seeds", "first score", "best score")),
            *(Column("CMA-ES - source", name) for name in ("mean", "better : worse")),
        ),
        tuple(rows),
        notes=(
            "Means over seeds with 95 % bootstrap intervals; differences are between runs with "
            "the same seed.",
        ),
    )


def main() -> None:
    """Measure, and write the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--tasks", nargs="+", default=TASKS)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--simulations", type=int, default=60)
    parser.add_argument("--engine", default="mujoco")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--runs", type=Path, default=Path("tuning.jsonl"))
    parser.add_argument("--page", type=Path, default=PAGE)
    options = parser.parse_args()
    runs = asyncio.run(measure(options))
    write(options.page, markdown(table(runs, options.simulations)), BEGIN)
    print(options.page)


if __name__ == "__main__":
    main()
