"""Compares MAP-Elites with MCTS at equal rollouts: how many kinds of machines they find.

    python benchmarks/kinds.py [--tasks throwing movement jumping] [--seeds 5] [--rollouts 100]

Runs the workflow `explore` as it is, and with MCTS in place of MAP-Elites: with the same first
machines, emitters and rollouts, so that only the choice of the machine to expand differs. Under
MCTS, refiners get no niche to aim at. Every simulated machine counts, kept or not.
Writes the table in docs/results/search.md from the seeds whose runs are all finished. Finished
runs are in benchmarks/data/kinds.jsonl and never repeated, so an interrupted comparison can be
continued.
"""

from __future__ import annotations

import argparse
import asyncio
import tempfile
from collections.abc import Mapping, Sequence
from functools import partial
from math import prod
from pathlib import Path
from typing import Any, Generic
from unittest.mock import patch

from budget import mean_text
from difficulty import Cells, level_key
from learning import write

from agentflow.app.design.run import RunOptions, design_async
from agentflow.config.run import build_config
from agentflow.env.mechanism import classify
from agentflow.env.pool.pool import RolloutPool
from agentflow.env.rollout import Rollout
from agentflow.env.simulation.variations import DEFAULT, Variation
from agentflow.env.tasks.base import Task, measure
from agentflow.env.tasks.registry import get_level, get_task
from agentflow.machine import Machine
from agentflow.metrics.tables import Column, Row, Table, markdown
from agentflow.prompts.render import PromptSet
from agentflow.search.elites.archive import Archive, Cell
from agentflow.search.events import SearchEvent, Simulated
from agentflow.search.mcts import mcts
from agentflow.search.node import C, Evaluation, Node, SearchResult
from agentflow.search.settings import MAP_ELITES
from agentflow.workflows import explore as workflow

HERE = Path(__file__).parent
CELLS, PAGE = HERE / "data" / "kinds.jsonl", HERE.parent / "docs" / "results" / "search.md"
BEGIN = "<!-- made by benchmarks/kinds.py: do not edit -->"
STRATEGIES = (MAP_ELITES, "mcts")
EMITTERS = {"random": ("edit", "crossover"), "procedural": ("refiner",)}
HALF = 0.5
"""Share of the good score that the best machine of a class that counts reaches."""
NUMBERS = ("coverage", "QD score", "best", "classes at half of good")
Found = dict[str, Any]


class Watch:
    """A pool that keeps every machine and its rollout."""

    def __init__(self, pool: RolloutPool) -> None:
        self._pool = pool
        self.seen: dict[Machine, Rollout] = {}

    async def run(
        self, machine: Machine, task: Task, *, seed: int = 0, variation: Variation = DEFAULT
    ) -> Rollout:
        """The rollout of a machine."""
        self.seen[machine] = await self._pool.run(machine, task, seed=seed, variation=variation)
        return self.seen[machine]


class Aimless(Archive[C], Generic[C]):
    """An archive that names no cell, so that refiners get no niche to aim at."""

    def cell_of(self, node: Node[C]) -> Cell | None:  # noqa: ARG002
        """No cell."""
        return None


async def mcts_beside_archive(*given: Any) -> SearchResult[Any]:
    """`mcts` with the arguments of `map_elites`; the archive only offers partners for crossover."""
    *arguments, observe, archive = given
    archive.offer(Node(0, arguments[0], None, arguments[1]))

    def watch(event: SearchEvent) -> None:
        if isinstance(event, Simulated):
            archive.offer(event.node)
        observe(event)

    return await mcts(*arguments, watch)


async def explore(task: str, seed: int, settings: Mapping[str, Any]) -> dict[Machine, Rollout]:
    """All machines that one run simulates."""
    document = {
        "task": task,
        "workflow": "explore",
        "seed": seed,
        "verify": False,
        "settings": {"trajectories": 4, "querier": False, **settings},
    }
    with tempfile.TemporaryDirectory() as folder:
        async with RolloutPool(2) as pool:
            watch = Watch(pool)
            await design_async(build_config(document), Path(folder), RunOptions(pool=watch))
    return watch.seen


def judge(task: str, machines: Mapping[Machine, Rollout]) -> Found:
    """The numbers of a run, and its best machine."""
    level, good = get_task(task), get_level(task).file.good
    archive = Archive[Machine]([item.axis for item in level.descriptors])
    classes: dict[str, float] = {}
    for number, (machine, rollout) in enumerate(machines.items()):
        kinds = measure(level.descriptors, machine, rollout)
        valid = rollout.status != "invalid"
        archive.offer(
            Node(number, machine, None, Evaluation(valid, rollout.score, measurements=kinds))
        )
        name, score = str(classify(machine, rollout)), rollout.score or 0.0
        classes[name] = max(score, classes.get(name, score))
    classes.pop(str(None), None)
    scores = [node.evaluation.score or 0.0 for node in archive.elites.values()]
    best = max(machines, key=lambda machine: machines[machine].score or 0.0)
    return {
        "rollouts": len(machines),
        "coverage": 100 * len(scores) / prod(axis.cells for axis in archive.axes),
        "QD score": sum(scores),
        "best": max(scores, default=0.0),
        "classes at half of good": sum(score >= HALF * good for score in classes.values()),
        "classes": classes,
        "machine": best.to_json(),
    }


def compare(task: str, seed: int, strategy: str, emitters: str, rollouts: int) -> Found:
    """The numbers of one run."""
    settings = {"max_simulations": rollouts, "emitters": EMITTERS[emitters]}
    if strategy == MAP_ELITES:
        return judge(task, asyncio.run(explore(task, seed, settings)))
    with patch.multiple(workflow, map_elites=mcts_beside_archive, Archive=Aimless):
        return judge(task, asyncio.run(explore(task, seed, settings)))


def tabulate(runs: Mapping[tuple[str, str], Mapping[str, Sequence[Found]]], rollouts: int) -> Table:
    """Means over seeds and their differences; runs by task and emitters, then by strategy."""
    rows = []
    for (task, emitters), both in runs.items():
        columns = {name: [[run[n] for run in both[name]] for n in NUMBERS] for name in STRATEGIES}
        for name, values in columns.items():
            rows.append(Row((task, emitters, name), tuple(map(mean_text, values))))
        pairs = zip(*(columns[name] for name in STRATEGIES), strict=True)
        apart = [[a - b for a, b in zip(*pair, strict=True)] for pair in pairs]
        rows.append(Row((task, emitters, "difference"), tuple(map(mean_text, apart))))
    seeds = min((len(both[MAP_ELITES]) for both in runs.values()), default=0)
    return Table(
        f"MAP-Elites and MCTS: {rollouts} rollouts, {seeds} seeds",
        ("task", "emitters", "strategy"),
        (Column("", "coverage, %"), *(Column("", name) for name in NUMBERS[1:])),
        tuple(rows),
        notes=(
            "Means over seeds with 95 % bootstrap intervals; differences are MAP-Elites minus MCTS "
            "with the same seed. If the interval of a difference includes 0, either may be ahead.",
        ),
    )


def main() -> None:
    """Make the missing runs, seed by seed, and write the table after each seed."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--tasks", nargs="+", default=["throwing", "movement", "jumping"])
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--rollouts", type=int, default=100)
    parser.add_argument("--page", type=Path, default=PAGE)
    options = parser.parse_args()
    known, prompts = Cells(CELLS), PromptSet().digest
    runs: dict[tuple[str, str], dict[str, list[Found]]] = {
        (task, emitters): {name: [] for name in STRATEGIES}
        for task in options.tasks
        for emitters in EMITTERS
    }
    for seed in range(options.seeds):
        for (task, emitters), both in runs.items():
            for name, found in both.items():
                given = (task, seed, name, emitters, options.rollouts)
                key = f"{level_key(task)} {' '.join(map(str, given[1:]))} {prompts}"
                found.append(known.get(key, partial(compare, *given)))
        write(options.page, markdown(tabulate(runs, options.rollouts)), BEGIN)
    print(options.page)


if __name__ == "__main__":
    main()
