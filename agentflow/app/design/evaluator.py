"""Simulates the machines of a run on a pool of workers."""

import asyncio
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from math import isclose

import numpy as np

from agentflow.env.constants import constants
from agentflow.env.drawing.look import look_at
from agentflow.env.drawing.stills import png_url
from agentflow.env.feedback.text import number
from agentflow.env.mechanism import classify
from agentflow.env.pool.pool import Simulator
from agentflow.env.pool.store import Rollouts
from agentflow.env.query import answer_each, wanted_interval, wanted_trial
from agentflow.env.rollout import Rollout, Trace
from agentflow.env.simulation.requirements import search_value
from agentflow.env.simulation.trials import SHOWN_TRIAL
from agentflow.env.simulation.variations import (
    DEFAULT,
    LITTLE,
    Variation,
    most_variations_of,
    perturbations_of,
    variations_of,
)
from agentflow.env.tasks.base import Task, measure
from agentflow.env.verification import Verification, robust_score, run_under, verify_async
from agentflow.errors import UsageError
from agentflow.holding import with_holding
from agentflow.machine import Machine, library, place
from agentflow.machine.geometry.balance import mass
from agentflow.machine.requirements import met_of
from agentflow.search.node import Evaluation
from agentflow.tools.host import Aims, Shot, SimulationSummary, Told
from agentflow.workflows.settings import Objective

PICTURE = (1440, 720)
"""Width and height of pictures for models, in pixels."""


class PhysicsEvaluator:
    """Simulates machines at one task. Implements the workflows' `Evaluator`."""

    def __init__(
        self,
        task: Task,
        pool: Simulator,
        seed: int,
        objective: Objective = "score",
        good: float | None = None,
        record: float | None = None,
    ) -> None:
        """Rollouts take random perturbations and gusts from `seed`; agents learn the good score
        and the record.

        With the objectives `robust` and `pareto`, the value of an evaluation is the robust score.
        With `pareto`, it has `objectives` as well.
        """
        self._objective = objective
        changes = [v.name for v in most_variations_of(task) if v is not DEFAULT]
        self.aims = Aims(good, record, len(changes), _changes_text(changes))
        self._task = task
        self._pool = pool
        self._seed = seed
        self.rollouts = Rollouts()
        """Every finished rollout under the default conditions, by machine digest."""
        self.statuses = Counter[str]()
        """How many of them ended how."""
        self._again = Rollouts()
        """Rollouts that were looked at again: single trials, and those with finer samples."""
        self.simulated_seconds = 0.0
        self.worker_seconds = 0.0
        """Time that workers spent on them."""
        self._verified: dict[str, Told] = {}
        """What agents have read of verified machines, by digest."""
        self._pictures: dict[str, asyncio.Task[str]] = {}

    async def evaluate(self, machine: Machine, label: str) -> Evaluation:  # noqa: ARG002
        """Simulate a machine."""
        rollout = await self._simulate(machine)
        self.rollouts.put(machine.digest, rollout)
        self.statuses[rollout.status] += 1
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
            met=met_of(rollout.requirements),
        )
        kinds = measure(self._task.descriptors, machine, rollout)
        valid = rollout.status != "invalid"
        missed = search_value(rollout, self._task.brief.requirements.mode)
        found = Evaluation(valid, rollout.score, summary, missed=missed, measurements=kinds)
        if self._objective != "score" and valid and found.score is not None:
            found = await self._with_value(found, machine, rollout)
        if self._objective == "pareto" and found.score is not None:
            found = replace(found, objectives=pareto_objectives(machine, found, rollout))
        return found

    async def _with_value(
        self, found: Evaluation, machine: Machine, default: Rollout
    ) -> Evaluation:
        """Add the robust score; without it, the evaluation has no score, like a crashed one."""
        world = await run_under(
            perturbations_of(machine), partial(self._simulate, machine), default
        )
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

    async def verify(self, machine: Machine, repeated: Sequence[Variation] = ()) -> Verification:
        """Verify an evaluated machine; see `verify_async`.

        These simulations count neither as rollouts nor in the times of this evaluator.
        """
        run = partial(self._pool.run, machine, self._task, seed=self._seed)
        default = self.rollouts[machine.digest]
        return await verify_async(machine, self._task, run, default, repeated)

    def count_changes(self, machine: Machine) -> int:
        """How many simulations verifying an evaluated machine takes."""
        return len(variations_of(machine, self._task)) - 1

    async def verified(self, machine: Machine) -> Told:
        """How the score of an evaluated machine holds; repeated only if it was incomplete."""
        told = self._verified.get(machine.digest) or _tell(await self.verify(machine))
        if told.data["score"] is not None:
            self._verified[machine.digest] = told
        return told

    async def feedback(self, machine: Machine, trial: int) -> Told:
        """The feedback of an evaluated machine, or that of one of its trials."""
        found = (await self._look_again(machine, trial)).feedback
        if not trial:
            return Told(found.text, found.data)
        lines = [line for line in found.text.splitlines() if not line.startswith("Score:")]
        return Told("\n".join([f"Trial {trial}:", *lines]), {**found.data, SHOWN_TRIAL: trial})

    async def query(self, machine: Machine, queries: Sequence[object]) -> Told:
        """Answer queries on a machine that has been evaluated."""
        asked = [(item, await self._rollout_for(machine, item)) for item in queries]
        answers = answer_each(machine, asked)
        return Told(answers.text, answers.data)

    async def _rollout_for(self, machine: Machine, query: object) -> Rollout | str:
        """The rollout that a query asks about, or why there is none."""
        trial, interval = wanted_trial(query), wanted_interval(query)
        samples = (interval or 0.0) / constants()["sample_interval"]
        recorded = round(samples) > 0 and isclose(samples, round(samples))
        try:
            if trial is not None:
                self._trial(trial)
            return await self._look_again(machine, trial or 0, None if recorded else interval)
        except UsageError as error:
            return str(error)

    async def _look_again(
        self, machine: Machine, trial: int = 0, interval: float | None = None
    ) -> Rollout:
        """The rollout of an evaluated machine, one of its trials, or either with other samples.

        What was not recorded is simulated again, which gives the same states.
        """
        shown = self.rollouts[machine.digest]
        if not trial and interval is None:
            return shown
        number = trial or int(shown.terms.get(SHOWN_TRIAL) or 0)
        key = f"{machine.digest}, trial {number}, every {interval}"
        if key not in self._again:
            task = self._trial(number) if number else self._task
            rollout = await self._pool.run(machine, task, seed=self._seed, interval=interval)
            terms = {SHOWN_TRIAL: float(number)} if number else {}
            self._again.put(key, replace(rollout, terms={**rollout.terms, **terms}))
        return self._again[key]

    def _trial(self, number: int) -> Task:
        """A trial of the task, by its number."""
        trials = self._task.trials(self._seed)
        if len(trials) == 1:
            raise UsageError("this task has no trials; leave out `trial`")
        if not 1 <= number <= len(trials):
            raise UsageError(f"there is no trial {number}; trials go from 1 to {len(trials)}")
        return trials[number - 1]

    async def views(self, machine: Machine) -> tuple[str, ...]:
        """Draw a machine as built, once, in a thread."""
        if machine.digest not in self._pictures:
            drawing = asyncio.to_thread(png_url, machine, view="sheet", size=PICTURE)
            self._pictures[machine.digest] = asyncio.ensure_future(drawing)
        return (await asyncio.shield(self._pictures[machine.digest]),)

    async def look(self, machine: Machine, shot: Shot) -> bytes:
        """Draw a machine in a thread: as built, or at times of its rollout."""
        rollout = await self._look_again(machine, shot.trial) if shot.times else None
        return await asyncio.to_thread(
            look_at, machine, shot.view, rollout, shot.times, shot.follow, shot.within
        )


def _changes_text(changes: Sequence[str]) -> str:
    """Names of variations in a phrase: what is a little more and a little less is named once."""
    little = f"{100 * LITTLE:g} %"
    more, less = f" +{little}", f" -{little}"
    both = ", ".join(name.removesuffix(more) for name in changes if name.endswith(more))
    others = ", ".join(name for name in changes if not name.endswith((more, less)))
    return f"{others}; {little} more and less of {both}"


def _tell(verification: Verification) -> Told:
    """A verification for agents: verified score and range, where it holds, then every score."""
    data = with_holding(verification.to_json())
    assert data is not None
    holding, scores = verification.holding, data["scores"]
    each = "; ".join(
        f"{item['variation']} {item['status'] if item['score'] is None else number(item['score'])}"
        for item in scores
    )
    if holding is None:
        return Told(f"not verified, because simulations stopped early: {each}", data)
    spread = f"{number(data['low'])} to {number(data['high'])}"
    return Told(f"verified score {number(data['score'])} ({spread}), {holding}: {each}", data)


def pareto_objectives(machine: Machine, found: Evaluation, rollout: Rollout) -> tuple[float, ...]:
    """Score, robust score, minus number of blocks and mass in kg, and what is required: the more
    the better, or the less.

    () for a machine that is invalid or scores 0, which the smallest machine does; this is
    constrained dominance (Deb et al. 2002).
    """
    if not found.valid or found.score is None or found.value is None or found.score <= 0:
        return ()
    required = (item.worth for item in rollout.requirements)
    return (found.score, found.value, -float(len(machine)), -mass(place(machine)), *required)


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
