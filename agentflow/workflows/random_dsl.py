"""Baseline without a model: random machines and random legal edits, selected by score alone."""

import random
from collections.abc import Sequence
from dataclasses import dataclass, replace

from agentflow.errors import UsageError
from agentflow.machine.edits.random import random_edit
from agentflow.machine.tree import Machine
from agentflow.runs.events import FLAWLESS, EditEvent, FirstAttempt
from agentflow.runs.locations import BLIND, FEEDBACK, INITIAL, RANDOM_EDITS, Location
from agentflow.search.concurrency import run_concurrently
from agentflow.search.node import SearchCost
from agentflow.search.tree import is_better
from agentflow.workflows.base import Candidate, Stage, WorkflowResult
from agentflow.workflows.context import WorkflowContext
from agentflow.workflows.settings import WorkflowSettings
from agentflow.workflows.stages.designs import draw_machine, simulate
from agentflow.workflows.workflow import Workflow

MAX_REPEATS = 20
"""Attempts to find an edit that leads to a new machine before a climb gives up."""


async def random_dsl(run: WorkflowContext) -> WorkflowResult:
    """Random machines, one random edit each, then edits of each trajectory's best machine.

    The stages are those of the other workflows. `settings.max_simulations` limits those of the
    whole run; by default every stage has one per trajectory, as in the published baseline.
    """
    rngs = {t: run.stream(f"traj-{t}") for t in run.trajectories}
    total = _rollouts(run.settings)
    run.begin_stage(INITIAL)
    start = run.settings.start_machine
    drawn = [draw_machine(t, rngs[t], run.brief, start=start) for t in list(rngs)[:total]]
    initial = run.end_stage(INITIAL, await simulate(run, INITIAL, drawn))
    left = total - initial.rollouts
    if run.is_over(initial) or left <= 0:
        return run.result()
    run.begin_stage(BLIND)
    blind = run.end_stage(BLIND, await _edit_each(run, initial.survivors[:left], rngs))
    left -= blind.rollouts
    if run.is_over(blind) or left <= 0:
        return run.result()
    run.begin_stage(FEEDBACK)
    run.end_stage(FEEDBACK, await _climb(run, _better_of(initial, blind), rngs, left))
    return run.result()


def _rollouts(settings: WorkflowSettings) -> int:
    return settings.max_simulations or 3 * settings.trajectories


async def _edit_each(
    run: WorkflowContext, candidates: Sequence[Candidate], rngs: dict[int, random.Random]
) -> list[Candidate]:
    """Edit each machine once, whatever its score, unless no machine can score higher."""
    edited = []
    for candidate in candidates:
        machine = candidate.machine
        assert machine is not None
        if not candidate.perfect:
            machine = _edit(run, machine, rngs[candidate.trajectory])
        reason = "" if machine else "no edit is legal"
        first = FLAWLESS if machine else FirstAttempt()
        edited.append(Candidate(candidate.trajectory, machine, None, first, reason))
    return await simulate(run, BLIND, edited)


def _edit(run: WorkflowContext, machine: Machine, rng: random.Random) -> Machine | None:
    try:
        return random_edit(machine, rng, run.brief)
    except UsageError:
        return None


def _better_of(initial: Stage, blind: Stage) -> list[Candidate]:
    """The better of the two machines of each trajectory; the first one if tied."""
    found = {candidate.trajectory: candidate for candidate in initial.survivors}
    for candidate in blind.survivors:
        assert candidate.evaluation is not None
        earlier = found[candidate.trajectory].evaluation
        assert earlier is not None
        if is_better(candidate.evaluation, earlier):
            found[candidate.trajectory] = candidate
    return list(found.values())


@dataclass
class _Climber:
    """One trajectory's climb: the best machine so far and the machines tried."""

    best: Candidate
    rng: random.Random
    seen: set[Machine]
    search_cost: SearchCost

    def next(self, run: WorkflowContext) -> Machine | None:
        """An untried machine one edit away from the best; None if none is found."""
        assert self.best.machine is not None
        for _ in range(MAX_REPEATS):
            machine = _edit(run, self.best.machine, self.rng)
            if machine is None:
                return None
            if machine not in self.seen:
                self.seen.add(machine)
                return machine
        return None


async def _climb(
    run: WorkflowContext, starts: Sequence[Candidate], rngs: dict[int, random.Random], rollouts: int
) -> list[Candidate]:
    """Edit each trajectory's best machine, keeping improvements, until the rollouts are used up.

    A climb ends when no machine can score higher.
    """
    climbers = [
        _Climber(start, rngs[start.trajectory], {start.machine}, SearchCost())
        for start in starts
        if start.machine is not None
    ]
    before, rounds = run.rollouts, 0
    while (left := rollouts - (run.rollouts - before)) > 0:
        rounds += 1
        climbing = [climber for climber in climbers if not climber.best.perfect]
        steps = await run_concurrently(_step(run, climber, rounds) for climber in climbing[:left])
        if not any(steps):
            break
    run.reached_greatest = any(climber.best.perfect for climber in climbers)
    return [replace(climber.best, search_cost=climber.search_cost) for climber in climbers]


async def _step(run: WorkflowContext, climber: _Climber, round_: int) -> bool:
    """Try one edit; returns whether there was one to try."""
    machine, old = climber.next(run), climber.best
    if machine is None:
        return False
    climber.search_cost.attempts += 1
    location = Location(FEEDBACK, trajectory=old.trajectory, round=round_)
    evaluation = await run.evaluate(machine, location)
    assert old.evaluation is not None
    kept = is_better(evaluation, old.evaluation)
    parent = old.machine.digest if old.machine else None
    run.note(EditEvent(location, parent, machine.digest, kept))
    climber.search_cost.expansions += 1
    climber.search_cost.valid += 1
    if kept:
        climber.best = Candidate(old.trajectory, machine, evaluation, FLAWLESS)
    return True


RANDOM_DSL = Workflow(
    "random-dsl", random_dsl, calls=lambda _: {}, rollouts=_rollouts, author=lambda _: RANDOM_EDITS
)
