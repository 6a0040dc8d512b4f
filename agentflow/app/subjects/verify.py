"""Scores of recorded machines again: verified under small variations, or with the current
environment."""

import asyncio
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import Any

from agentflow.app.design.execution import verification_event
from agentflow.app.design.plan import RunPlan, engine_of_run, level_note
from agentflow.app.inspect.overview import later_note
from agentflow.app.subjects.subject import Origin, Subject
from agentflow.env.constants import constants
from agentflow.env.physics.engines import choose_engine, usable_engine
from agentflow.env.pool.pool import Pool, RolloutPool, Simulator
from agentflow.env.verification import Verification, other_engines, score_on_others, verify_async
from agentflow.holding import with_holding
from agentflow.metrics.machines import recorded_machine
from agentflow.runs import Notify, RunDirectory, read_document, read_result
from agentflow.runs.events import EvaluationEvent, read_typed_events


def rescore(path: Path, workers: int | None = None, engine: str | None = None) -> dict[str, Any]:
    """Simulate every machine of a run again and compare.

    Args:
        path: The run, finished or not; it is not changed.
        workers: Number of processes; None: as configured in the run.
        engine: Name of the physics engine; None: that of the run, or the default one if it is not
            installed.

    Returns:
        `run`, `task`, `note` (whether its level has changed), `constants` and `engine` (`recorded`
        and `now`), `identical` (number of machines with a bit-for-bit identical rollout), and
        `machines`: each with `machine`, `place` (where it was first simulated), `recorded` and
        `now` (status and score), `difference` of the scores (None if one is missing),
        `identical`, and `note`: a later rule that it breaks, which does not change its score.
    """
    document = read_document(path)
    plan = RunPlan.of_run(path, document, engine or usable_engine(engine_of_run(document)))
    evaluations: dict[str, EvaluationEvent] = {}
    for event in read_typed_events(path):
        if isinstance(event, EvaluationEvent):
            evaluations.setdefault(event.machine, event)

    async def compare() -> list[dict[str, Any]]:
        async with RolloutPool(workers or plan.config.workers) as pool:
            return list(await asyncio.gather(*(again(one, pool) for one in evaluations)))

    async def again(digest: str, pool: Pool) -> dict[str, Any]:
        machine, evaluation = recorded_machine(path, digest), evaluations[digest]
        subject = Subject(machine, plan.task, plan.config.seed, evaluation.label, recorded=True)
        rollout = await subject.simulate(pool)
        old, new = evaluation.score, rollout.score
        return {
            "machine": digest,
            "place": evaluation.label,
            "recorded": {"status": evaluation.status, "score": old},
            "now": {"status": rollout.status, "score": new},
            "difference": None if old is None or new is None else new - old,
            "identical": rollout.digest == evaluation.rollout and old == new,
            "note": later_note(machine, plan.task.brief),
        }

    machines = asyncio.run(compare())
    return {
        "run": str(path),
        "task": plan.task.name,
        "note": level_note(path, document),
        "constants": {"recorded": document.get("constants"), "now": constants().digest},
        "engine": {"recorded": document.get("engine"), "now": plan.engine},
        "identical": sum(item["identical"] for item in machines),
        "machines": machines,
    }


def verify(subject: Subject, workers: int, notify: Notify) -> dict[str, Any]:
    """The verified score of a machine.

    A complete verification in its run is returned as it is. Otherwise the machine is verified, and
    the result is stored in the run, if any, provided that the machine still has its recorded score.

    Args:
        subject: The machine and its task.
        workers: Number of processes.
        notify: Receives the reason if the result is not stored.

    Returns:
        `task`, `seed`, `engine` (name and version, that of the run), `score` (the plain one, that
        of the run), `verified` (see `with_holding`), `others` (see `score_on_others`) and
        `problems` (why the machine is invalid); `run` first if there is one.

    Raises:
        RunError: The run cannot be written.
        ConfigError: The run was not verified, and its engine is not installed.
    """
    run = subject.run
    missing = run is None or run.result.verified_score is None
    if missing:
        subject.require_engine()
    verification, others = asyncio.run(_simulate(subject, workers, missing))
    engine = run.document.get("engine") if run else str(choose_engine(subject.task.engine).identity)
    told = {"task": subject.task.name, "seed": subject.seed, "engine": engine}
    verified = None if verification is None else with_holding(verification.to_json())
    found = {"verified": verified, "others": others, "problems": []}
    if run is None:
        assert verification is not None  # was missing
        now = verification.default
        return {**told, "score": now.score, **found, "problems": list(map(dict, now.problems))}
    if verification is not None:
        _keep(run, subject, verification, notify)
    found["verified"] = verified or with_holding(run.result.to_json()["verified"])
    return {"run": str(run.path), **told, "score": run.result.score, **found}


async def verify_finished(path: Path, pool: Simulator) -> None:
    """Verify a finished run that is not verified, if it has a valid machine, and store that."""
    if read_result(path).valid:
        subject = Subject.of_run(path)
        subject.require_engine()
        assert subject.machine is not None
        assert subject.run is not None
        run = partial(pool.run, subject.machine, subject.task, seed=subject.seed)
        _store(subject.run, subject, await verify_async(subject.machine, subject.task, run))


async def _simulate(
    subject: Subject, workers: int, missing: bool
) -> tuple[Verification | None, list[dict[str, Any]]]:
    """The verification if it is missing, and the scores on other engines."""
    if subject.machine is None:
        return Verification.invalid(subject.faults), []
    pool = RolloutPool(workers)
    run = partial(subject.simulate, pool)
    async with pool if missing or other_engines(subject.task) else nullcontext():
        found = await verify_async(subject.machine, subject.task, run) if missing else None
        return found, await score_on_others(run, subject.task)


def _keep(run: Origin, subject: Subject, verification: Verification, notify: Notify) -> None:
    """Store a verification, or say why not."""
    now, recorded = verification.default, run.result.score
    if now.score == recorded:
        _store(run, subject, verification)
        return
    found = now.status if now.score is None else f"{now.score:.2f}"
    notify(
        f"the verification is not stored in {run.path}: the recorded score is {recorded:.2f}, but "
        f"simulated again with current physics, it is {found}"
    )


def _store(run: Origin, subject: Subject, verification: Verification) -> None:
    """Record the verification as `design` would have, so that a replay reproduces it."""
    assert subject.machine is not None  # as every run that is a subject has one
    directory = RunDirectory.resume(run.path)
    try:
        directory.event(verification_event(subject.machine, verification))
        directory.finish(run.result.with_verification(verification.to_json()))
    finally:
        directory.close()
