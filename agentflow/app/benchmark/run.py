"""Carries out a benchmark and makes its scorecard from the finished runs."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from datetime import datetime, timezone
from pathlib import Path
from shlex import quote
from typing import Any

from agentflow.app.benchmark.card import (
    DIGITS,
    FIRST,
    LONG,
    NAME,
    Cost,
    CountedMachine,
    ItemResult,
    Outcome,
    Point,
    Scorecard,
    summarise,
    write_card,
)
from agentflow.app.benchmark.plan import CALLS, ITEM, PART, Item, conditions, read_items
from agentflow.app.design.execution import best_machine
from agentflow.app.design.trust import trust_option
from agentflow.app.sweeps.plan import SweepPlan
from agentflow.app.sweeps.run import Watcher, run_blocking, run_sweep_async
from agentflow.app.sweeps.tables import FinishedRun, SweepResult, read_sweep_result
from agentflow.app.sweeps.views import total_usage
from agentflow.config.run import build_config
from agentflow.errors import EndpointError
from agentflow.files.documents import digest_of
from agentflow.machine import Machine
from agentflow.metrics.machines import recorded_machine
from agentflow.metrics.usage import spent_on
from agentflow.models.choices import cost_function
from agentflow.runs import read_calls
from agentflow.runs.events import AttemptEvent, EvaluationEvent, ProgramEvent, read_typed_events
from agentflow.runs.locations import INITIAL
from agentflow.runs.record import RunRecord
from agentflow.runs.result import BUDGET
from agentflow.version import __version__
from agentflow.workflows.registry import WORKFLOWS


@dataclass(frozen=True)
class BenchmarkOutcome:
    """The card of a benchmark, and its file."""

    file: Path
    card: Scorecard


def run_benchmark(
    plan: SweepPlan, folder: Path, watcher: Watcher, *, jobs: int, resume: bool
) -> BenchmarkOutcome:
    """Carry out the unfinished runs, and write the card; see `run_sweep_async`.

    Raises:
        EndpointError: All runs failed because of the endpoint.
    """
    work = run_sweep_async(plan, folder, watcher, jobs=jobs, resume=resume)
    runs = run_blocking(work, plan, folder)
    if runs.endpoint and not runs.done:
        raise EndpointError(
            "no run could use its endpoint, so there is no scorecard; when it answers, continue "
            f"with: agentflow benchmark {quote(str(folder))} --resume{trust_option(plan.configs)}"
        )
    card, file = make_card(read_sweep_result(folder)), folder / NAME
    write_card(file, card)
    return BenchmarkOutcome(file, card)


def make_card(result: SweepResult) -> Scorecard:
    """The card of the finished runs."""
    sweep = result.sweep
    done = {run.planned.name: run for run in result.finished}
    items = tuple(_result(result, name, item, done) for name, item in read_items(sweep).items())
    shared = conditions(sweep)
    spent = total_usage(result.finished).total
    return Scorecard(
        agentflow=__version__,
        conditions=shared,
        digest=digest_of(shared),
        model=result.finished[0].result.model,
        sampling=build_config(sweep.base).model.sampling.model_dump(mode="json"),
        made=datetime.now(timezone.utc).date().isoformat(),
        **summarise(items),
        items=items,
        cost=Cost(
            calls=spent.calls,
            prompt_tokens=spent.prompt,
            completion_tokens=spent.completion,
            money=spent.money,
            rollouts=sum(run.result.rollouts for run in result.finished),
        ),
        isolated=_isolated(result.finished),
    )


def _isolated(runs: Iterable[FinishedRun]) -> bool | None:
    """Whether all agent programs of runs were isolated; None without any."""
    events = (
        event
        for run in runs
        if WORKFLOWS[run.planned.config.workflow].runs_program
        for event in read_typed_events(run.path)
    )
    found = [bool(event.isolated) for event in events if isinstance(event, ProgramEvent)]
    return all(found) if found else None


def _result(
    result: SweepResult, name: str, item: Item, done: Mapping[str, FinishedRun]
) -> ItemResult:
    parts: dict[str, tuple[CountedMachine, ...]] = {}
    for planned in result.planned:
        part, of = (planned.labels[axis] for axis in (PART, ITEM))
        if of == name:
            run = done.get(planned.name)
            found = _machines(run, item, result) if run else _missing(result, planned.name)
            numbered = (one.model_copy(update={"seed": planned.config.seed}) for one in found)
            parts[part] = (*parts.get(part, ()), *numbered)
    return ItemResult(
        item=name,
        family=item.task.family,
        task=item.task.name,
        knobs=dict(item.knobs),
        full=item.par.par,
        parts=parts,
    )


def _machines(run: FinishedRun, item: Item, result: SweepResult) -> tuple[CountedMachine, ...]:
    """What counts of a finished run."""
    part, most = run.planned.labels[PART], run.planned.config.model.budget.calls
    planned = CALLS in result.sweep.axes[PART][part]  # else it is a limit of the user
    spent = planned and most is not None and run.result.calls >= most
    if run.result.stopped == BUDGET and not spent:
        return (_without_score("stopped", "the budget was used up"),)
    if part == FIRST:
        return _replies(run, item)
    best = _best(run, item)
    return (best.model_copy(update=_course(run, item)) if part == LONG else best,)


def _course(run: FinishedRun, item: Item) -> dict[str, Any]:
    """Where the best share of a run rose, and its mean over all simulations that it may make."""
    config, record, points = run.planned.config, RunRecord(), list[Point]()
    cost = cost_function(config.model)
    money = {call["request"]["label"]: spent_on(call, cost).money for call in read_calls(run.path)}
    simulated, spent = set[str](), list[float | None]()
    for event in read_typed_events(run.path):
        record.add(event)
        if isinstance(event, AttemptEvent):
            spent.append(money.get(event.label))
        elif isinstance(event, EvaluationEvent) and event.valid:
            simulated.add(event.machine)
            share = item.share(record.best or 0.0)
            if not points or share > points[-1].share:
                paid = None if None in spent else round(sum(one or 0.0 for one in spent), DIGITS)
                simulations, tokens = len(simulated), record.tokens
                points.append(
                    Point(simulations=simulations, tokens=tokens, money=paid, share=share)
                )
    most = config.settings.max_simulations or len(simulated)
    ends = [*(point.simulations for point in points[1:]), most + 1]
    area = sum(p.share * (end - p.simulations) for p, end in zip(points, ends, strict=False))
    return {"course": tuple(points), "area": round(area / max(most, 1), DIGITS)}


def _replies(run: FinishedRun, item: Item) -> tuple[CountedMachine, ...]:
    """The first replies of a run, with plain scores."""
    statuses = _statuses(run)
    return tuple(
        _attempt(
            recorded_machine(run.path, found.machine),
            statuses.get(found.machine, "ok"),
            found.score,
            item,
        )
        if found.valid and found.machine
        else CountedMachine(outcome="invalid", score=0.0, share=0.0, reason=found.reason)
        for found in run.numbers.record.of_stage(INITIAL)
    )


def _best(run: FinishedRun, item: Item) -> CountedMachine:
    """The best machine of a run, with its verified score, or the lowest where that counts."""
    result = run.result
    machine = best_machine(result)
    if machine is None:
        return CountedMachine(outcome="invalid", score=0.0, share=0.0, reason=result.reason)
    status, verified = _statuses(run).get(machine.digest, "ok"), result.verified
    if status in ("ok", "diverged") and result.verified_score is None:
        return _without_score("unverified", "a simulation of the verification failed")
    lowest = None if verified is None else verified.low
    score = lowest if item.lowest else result.verified_score
    found = _attempt(machine, status, score, item, result.fragile)
    return found.model_copy(update={"met": result.met})


def _attempt(
    machine: Machine, status: str, score: float | None, item: Item, fragile: bool | None = None
) -> CountedMachine:
    if score is None:
        return _without_score("simulation_failed", f"the simulation ended with status {status}")
    outcome: Outcome = "diverged" if status == "diverged" else "scored"
    return CountedMachine(
        outcome=outcome,
        score=round(score, DIGITS),
        share=item.share(score),
        fragile=fragile,
        machine=json.dumps(machine.to_json(), separators=(",", ":")),
    )


def _missing(result: SweepResult, run: str) -> tuple[CountedMachine, ...]:
    """What takes the place of a run that is not finished."""
    why = "failed; members.jsonl has the reason" if run in result.failed else "is unfinished"
    return (_without_score("missing", f"the run {why}"),)


def _without_score(outcome: Outcome, reason: str) -> CountedMachine:
    return CountedMachine(outcome=outcome, score=None, share=None, reason=reason)


def _statuses(run: FinishedRun) -> dict[str, str]:
    """Content hash of each simulated machine -> status of its simulation."""
    events = read_typed_events(run.path)
    return {item.machine: item.status for item in events if isinstance(item, EvaluationEvent)}
