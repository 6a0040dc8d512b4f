"""Measures how robust a design is, and keeps that in the run that it is from."""

import asyncio
import json
from collections.abc import Sequence
from functools import partial
from random import Random
from typing import Any

from agentflow.app.subjects.subject import Subject
from agentflow.env.physics.engines import choose_engine
from agentflow.env.pool.pool import RolloutPool
from agentflow.env.verification import Perturbation, perturb, score_on_others
from agentflow.errors import RunError
from agentflow.files.atomic import write_file
from agentflow.machine import Machine, library
from agentflow.machine.edits.random import Neighbour, all_neighbours, sample_neighbours
from agentflow.progress import Progress

KEPT = "robustness.json"
"""File of a run in which its report finds the result."""


def measure_robustness(
    subject: Subject, *, count: int | None, workers: int, say: Progress
) -> dict[str, Any]:
    """Simulate a machine under changed conditions, and its neighbours.

    The result for the best machine of a run is kept in the run.

    Args:
        subject: The machine and its task; its seed is also that of the draw of neighbours.
        count: Number of neighbours, drawn at random; None for all.
        workers: Processes.
        say: Told the number of simulations done, and of all.

    Returns:
        `task`, `seed`, `engine`, `machine` (its construction tree), `score` (the plain one),
        `robust`, `world` and `edits` (see `Spread.to_json`), `conditions` (variation, status and
        score of each), `others` (see `score_on_others`), `blocks` and `faces` (the most sensitive
        first), and `problems` (why the machine is invalid; everything else but the first three is
        then empty or None); `run` first if there is one.

    Raises:
        RunError: The run cannot be written.
        ConfigError: The engine of the run is not installed.
    """
    subject.require_engine()
    task, seed, machine = subject.task, subject.seed, subject.machine
    found: dict[str, Any] = {
        "task": task.name,
        "seed": seed,
        "engine": str(choose_engine(task.engine).identity),
    }
    if machine is None or subject.problems:
        found |= dict.fromkeys(("machine", "score", "robust", "world", "edits"))
        found |= {"conditions": [], "others": [], "blocks": [], "faces": []}
        found["problems"] = [item.to_json() for item in subject.problems]
    else:
        rng = Random(f"perturb/{seed}")
        neighbours: Sequence[Neighbour] = (
            list(all_neighbours(machine, task.brief, rng))
            if count is None
            else sample_neighbours(machine, task.brief, rng, count)
        )
        perturbed, others = asyncio.run(_simulate(subject, machine, neighbours, workers, say))
        found |= {**_to_json(perturbed, machine), "others": others, "problems": []}
    if subject.run is None:
        return found
    write_file(subject.run.path / KEPT, json.dumps(found) + "\n", RunError)
    return {"run": str(subject.run.path), **found}


async def _simulate(
    subject: Subject, machine: Machine, neighbours: Sequence[Neighbour], workers: int, say: Progress
) -> tuple[Perturbation, list[dict[str, Any]]]:
    task, seed = subject.task, subject.seed
    async with RolloutPool(workers) as pool:
        found = await perturb(machine, neighbours, partial(pool.run, task=task, seed=seed), say)
        return found, await score_on_others(partial(subject.simulate, pool), task)


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
