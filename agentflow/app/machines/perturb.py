"""Measures how robust a design from a file is."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from functools import partial
from random import Random
from typing import Any

from agentflow.env.perturbation import Perturbation, perturb
from agentflow.env.physics.engines import choose_engine
from agentflow.env.pool.pool import RolloutPool
from agentflow.env.tasks.base import Task
from agentflow.env.verification import score_on_others
from agentflow.machine import Machine, check, library
from agentflow.machine.edits.neighbours import Neighbour, all_neighbours, sample_neighbours
from agentflow.machine.formats.detect import read_for


def perturb_text(
    text: object,
    task: Task,
    *,
    count: int | None,
    seed: int,
    workers: int,
    say: Callable[[int, int], None],
) -> dict[str, Any]:
    """Simulate one machine given as text or data under changed conditions, and its neighbours.

    Args:
        text: The machine.
        task: The level.
        count: Number of neighbours, drawn at random; None for all.
        seed: Of the draw, and of the task's trials.
        workers: Processes.
        say: Told the number of simulations done, and of all.

    Returns:
        `task`, `seed`, `engine`, `machine` (its construction tree), `score` (the plain one),
        `robust`, `world` and `edits` (see `Spread.to_json`), `conditions` (variation, status and
        score of each), `others` (see `score_on_others`), `blocks` and `faces` (the most sensitive
        first), and `problems` (why the machine is invalid; everything else but the first three is
        then empty or None).
    """
    report = check(read_for(task.brief, text), task.brief)
    told: dict[str, Any] = {
        "task": task.name,
        "seed": seed,
        "engine": str(choose_engine(task.engine).identity),
    }
    machine = report.machine
    if machine is None or report.problems:
        nothing = dict.fromkeys(("machine", "score", "robust", "world", "edits"))
        empty: dict[str, list[Any]] = {"conditions": [], "others": [], "blocks": [], "faces": []}
        return {
            **told,
            **nothing,
            **empty,
            "problems": [item.to_json() for item in report.problems],
        }
    rng = Random(f"perturb/{seed}")
    if count is None:
        neighbours: Sequence[Neighbour] = list(all_neighbours(machine, task.brief, rng))
    else:
        neighbours = sample_neighbours(machine, task.brief, rng, count)
    found, others = asyncio.run(_simulate(machine, neighbours, task, seed, workers, say))
    return {**told, **_to_json(found, machine), "others": others, "problems": []}


async def _simulate(
    machine: Machine,
    neighbours: Sequence[Neighbour],
    task: Task,
    seed: int,
    workers: int,
    say: Callable[[int, int], None],
) -> tuple[Perturbation, list[dict[str, Any]]]:
    async with RolloutPool(workers) as pool:
        found = await perturb(machine, neighbours, partial(pool.run, task=task, seed=seed), say)
        return found, await score_on_others(partial(pool.run, machine, seed=seed), task)


def _to_json(found: Perturbation, machine: Machine) -> dict[str, Any]:
    def name(block: int) -> str:
        return library()[machine[block].type].name

    return {
        "machine": machine.to_json(),
        "score": found.default.score,
        "robust": found.robust,
        "world": found.world_spread.to_json(),
        "conditions": [
            {"variation": key, "status": rollout.status, "score": rollout.score}
            for key, rollout in found.world.items()
        ],
        "edits": found.edits_spread.to_json(),
        "blocks": [
            {"block": block, "name": name(block), "mean": mean}
            for block, mean in found.blocks.items()
        ],
        "faces": [
            {"block": block, "name": name(block), "face": face, "mean": mean}
            for (block, face), mean in found.faces.items()
        ],
    }
