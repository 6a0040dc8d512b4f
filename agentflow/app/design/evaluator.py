"""Simulates the machines of a run on a pool of workers."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from agentflow.env.drawing.look import look_at
from agentflow.env.drawing.stills import png_url
from agentflow.env.mechanism import classify
from agentflow.env.perturbation import robust_score
from agentflow.env.pool.base import Simulator
from agentflow.env.pool.spool import Rollouts
from agentflow.env.query import answer_queries
from agentflow.env.rollout import Rollout, Trace
from agentflow.env.simulation.variations import DEFAULT, PERTURBATIONS, Variation
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.descriptors import measure
from agentflow.env.verification import Verification, run_under, verify_async
from agentflow.machine.blocks.library import library
from agentflow.machine.geometry.balance import mass
from agentflow.machine.geometry.placement import place
from agentflow.machine.tree import Machine
from agentflow.search.node import Evaluation
from agentflow.tools.host import Shot
from agentflow.workflows.base import SimulationSummary
from agentflow.workflows.settings import Objective

PICTURE = (960, 720)
"""Width and height of pictures for models, in pixels."""


class PhysicsEvaluator:
    """Simulates machines at one task. Implements the workflows' `Evaluator`."""

    def __init__(
        self, task: Task, pool: Simulator, seed: int, objective: Objective = "score"
    ) -> None:
        """Rollouts take random perturbations and gusts from `seed`.

        With the objectives `robust` and `pareto`, the value of an evaluation is the robust score.
        With `pareto`, it has `objectives` as well.
        """
        self._objective = objective
        self._task = task
        self._pool = pool
        self._seed = seed
        self.rollouts = Rollouts()
        """Every finished rollout under the default conditions, by machine digest."""
        self.simulated_seconds = 0.0
        """Simulated time of all rollouts."""
        self.worker_seconds = 0.0
        """Time that workers spent on them."""
        self._pictures: dict[str, asyncio.Task[str]] = {}

    async def evaluate(self, machine: Machine, label: str) -> Evaluation:  # noqa: ARG002
        """Simulate a machine."""
        rollout = await self._simulate(machine)
        self.rollouts.put(machine.digest, rollout)
        mechanism = classify(machine, rollout)
        summary = SimulationSummary(
            score=rollout.score,
            status=rollout.status,
            feedback=rollout.feedback.text,
            broken=tuple((item.block, item.partner, item.time) for item in rollout.broken),
            digest=rollout.digest,
            moved=None if rollout.trace is None else farthest_move(rollout.trace),
            mechanism=None if mechanism is None else str(mechanism),
            success=None if (met := rollout.terms.get("success")) is None else bool(met),
            facts=decisive_facts(machine, rollout),
        )
        kinds = measure(self._task.descriptors, machine, rollout)
        valid = rollout.status != "invalid"
        found = Evaluation(valid, rollout.score, summary, measurements=kinds)
        if self._objective != "score" and valid and found.score is not None:
            found = await self._with_value(found, machine, rollout)
        if self._objective == "pareto" and found.score is not None:
            found = replace(found, objectives=pareto_objectives(machine, found))
        return found

    async def _with_value(
        self, found: Evaluation, machine: Machine, default: Rollout
    ) -> Evaluation:
        """Add the robust score; without it, the evaluation has no score, like a crashed one."""
        world = await run_under(PERTURBATIONS, partial(self._simulate, machine), default)
        value = robust_score(world)
        if value is not None:
            return replace(found, value=value)
        status = next(rollout.status for rollout in world.values() if rollout.score is None)
        return replace(found, score=None, details=replace(found.details, score=None, status=status))

    async def _simulate(self, machine: Machine, variation: Variation = DEFAULT) -> Rollout:
        rollout = await self._pool.run(machine, self._task, seed=self._seed, variation=variation)
        self.simulated_seconds += rollout.sim_seconds or 0.0
        self.worker_seconds += rollout.wall_seconds or 0.0
        return rollout

    async def verify(self, machine: Machine) -> Verification:
        """Simulate an evaluated machine under every variation.

        These simulations count neither as rollouts nor in the times of this evaluator.
        """
        run = partial(self._pool.run, machine, self._task, seed=self._seed)
        return await verify_async(run, self.rollouts[machine.digest])

    async def query(self, machine: Machine, queries: Sequence[object]) -> str:
        """Answer queries on a machine that has been evaluated."""
        return answer_queries(machine, self.rollouts[machine.digest], queries).text

    async def views(self, machine: Machine) -> tuple[str, ...]:
        """Draw a machine as built, once, in a thread."""
        if machine.digest not in self._pictures:
            drawing = asyncio.to_thread(png_url, machine, view="sheet", size=PICTURE)
            self._pictures[machine.digest] = asyncio.ensure_future(drawing)
        return (await asyncio.shield(self._pictures[machine.digest]),)

    async def look(self, machine: Machine, shot: Shot) -> bytes:
        """Draw a machine in a thread: as built, or at times of its rollout."""
        rollout = self.rollouts[machine.digest] if shot.times else None
        return await asyncio.to_thread(
            look_at, machine, shot.view, rollout, shot.times, shot.follow, shot.within
        )


def pareto_objectives(machine: Machine, found: Evaluation) -> tuple[float, ...]:
    """Score, robust score, and minus number of blocks and mass in kg.

    () for a machine that is invalid or scores 0, which the smallest machine does; this is
    constrained dominance (Deb et al. 2002).
    """
    if not found.valid or found.score is None or found.value is None or found.score <= 0:
        return ()
    return (found.score, found.value, -float(len(machine)), -mass(place(machine)))


def decisive_facts(machine: Machine, rollout: Rollout) -> dict[str, str]:
    """What edit histories report besides the score: release or take-off, and the first break.

    Blocks are named by type, because their ids change.
    """
    facts, data = {}, rollout.feedback.data
    if release := data.get("release"):
        flight = f"{release['speed']:.1f} m/s at {release['elevation']:.0f} degrees"
        facts[data["moment"]["name"]] = flight
    if first := min(rollout.broken, key=lambda item: item.time, default=None):
        names = [library()[machine[id_].type].name for id_ in (first.block, first.partner)]
        facts["first break"] = f"{' off '.join(names)} at {first.time:.2f} s"
    return facts


def farthest_move(trace: Trace) -> float:
    """Largest distance of any block's centre from its initial position, m, to the millimetre."""
    away = np.linalg.norm(trace.centre - trace.centre[0], axis=-1)
    return round(float(away.max()), 3)
