"""Where climbing can pay: what single edits do to good first machines. For docs/results/search.md.

The procedural model makes first machines, as the first half of a search does. Random legal edits,
those of the emitter `edit`, are tried on the best four. Beside them stands what more first machines
are worth: the mean best of 40 and of 85, drawn from all of them. MuJoCo.
"""

from __future__ import annotations

import argparse
import asyncio
import sys
from pathlib import Path
from random import Random
from statistics import fmean

from budget import PAGE
from learning import write

from agentflow.app.tasks import find_task
from agentflow.env.pool.pool import RolloutPool
from agentflow.env.tasks.base import Task
from agentflow.machine.edits.local import local_edit
from agentflow.machine.tree import Machine
from agentflow.metrics.tables import Column, Row, Table, markdown

sys.path.insert(0, str(Path(__file__).parent.parent))
from tests.llm.procedural.asking import whole_design

BEGIN = "<!-- made by benchmarks/edits.py: do not edit -->"
TASKS = ("throwing", "movement/2", "delivery", "flying", "lifting/3", "bridge/2")
FIRST, BEST, EDITS = 120, 4, 60
"""First machines, how many of them are edited, and edits of each."""
DRAWS = 2000
"""Samples of 40 and of 85 first machines."""
COUNTS = (40, 85)


async def scores(machines: list[Machine], task: Task, pool: RolloutPool) -> list[float]:
    """Their scores; a failed simulation counts as 0."""
    rollouts = await asyncio.gather(*(pool.run(machine, task) for machine in machines))
    return [rollout.score or 0.0 for rollout in rollouts]


async def row(task: Task, pool: RolloutPool) -> Row:
    """What first machines and edits of the best ones score."""
    rng = Random(0)
    designs = [await whole_design(task.brief, seed) for seed in range(FIRST)]
    machines = [made.machine for made in designs if made]
    firsts = await scores(machines, task, pool)
    best = [
        fmean(max(rng.sample(firsts, min(count, len(firsts)))) for _ in range(DRAWS))
        for count in COUNTS
    ]
    of_machine = dict(zip(machines, firsts, strict=True))
    gains: list[float] = []
    for machine in sorted(of_machine, key=of_machine.__getitem__, reverse=True)[:BEST]:
        edited = [local_edit(machine, rng, task.brief)[1] for _ in range(EDITS)]
        found = await scores(edited, task, pool)
        gains += [score - of_machine[machine] for score in found]
    better = [gain for gain in gains if gain > 0.001 * max(firsts)]
    print(task.name, best, len(better), max(gains), flush=True)
    return Row(
        (task.name,),
        (
            *(f"{value:.1f}" for value in best),
            f"{len(better)} of {len(gains)}",
            f"{fmean(better):.1f}" if better else "",
            f"{max(gains):.1f}" if better else "",
        ),
    )


async def measure(options: argparse.Namespace) -> Table:
    """All rows."""
    async with RolloutPool(options.workers) as pool:
        rows = [await row(find_task(name, (), "mujoco"), pool) for name in options.tasks]
    return Table(
        f"First machines, and {EDITS} edits of each of the best {BEST} of {FIRST}",
        ("task",),
        (
            *(Column("mean best first machine of", str(count)) for count in COUNTS),
            *(Column("single edits", name) for name in ("better", "mean gain", "greatest gain")),
        ),
        tuple(rows),
        notes=("An edit is better if it gains more than 0.1 % of the best first score.",),
    )


def main() -> None:
    """Measure, and write the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--tasks", nargs="+", default=TASKS)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--page", type=Path, default=PAGE)
    options = parser.parse_args()
    write(options.page, markdown(asyncio.run(measure(options))), BEGIN)
    print(options.page)


if __name__ == "__main__":
    main()
