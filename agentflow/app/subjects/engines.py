"""Compares the installed physics engines: what machines score on each, and how each ranks them."""

import asyncio
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from agentflow.agents.base import AskContext, ask
from agentflow.agents.designer import Designer
from agentflow.app.subjects.subject import Subject
from agentflow.env.physics.engine import EngineSpec
from agentflow.env.physics.engines import installed_engines
from agentflow.env.physics.registry import ENGINES
from agentflow.env.pool.pool import RolloutPool
from agentflow.env.rollout import Rollout
from agentflow.env.tasks.records import TaskRecord, read_records, record_machine
from agentflow.env.tasks.registry import FAMILIES, get_task
from agentflow.errors import ConfigError
from agentflow.extras import is_installed
from agentflow.llm.messages import Sampling
from agentflow.llm.procedural import ProceduralClient
from agentflow.machine import Machine
from agentflow.machine.brief import LONE_ROOT
from agentflow.metrics.intervals import missing_scipy
from agentflow.progress import Progress, counter
from agentflow.prompts.render import PromptSet

NO_MACHINES = (
    "The machines of records are not in the package but in its repository: run this in a clone of "
    "it to compare them."
)


def compare_engines(
    machines: int, workers: int, say: Progress, records: Mapping[str, TaskRecord] | None = None
) -> dict[str, Any]:
    """Simulate records, and machines of the procedural model, on every installed engine.

    Args:
        machines: Number of procedural machines per family that is `ranked`.
        workers: Number of processes.
        say: Receives progress.
        records: Name -> record; by default those of all levels, without changed knobs.

    Returns:
        `engines` (name and version of each, the default one first); `machines`: of each record
        `machine`, `task` and `results`, one per engine; `families`: of each `family`, the number of
        its `machines` that every engine simulated, and `correlations`: Spearman's between the
        scores on the default engine and on each of the others, None if it is undefined; `note`: why
        there are no machines of records or no correlations, or "".

    Raises:
        ConfigError: Only one engine is installed.
    """
    engines = require_several(installed_engines())
    if records is None:
        records = {name: one for name, one in read_records().items() if not one.knobs}
    known = [
        Subject(machine, get_task(record.task, record.knobs), record.seed, name, recorded=True)
        for name, record in records.items()
        if (machine := record_machine(name))
    ]
    drawn = asyncio.run(_draw_machines(machines))
    cases = [*known, *drawn]
    tick = counter(say, len(cases) * len(engines))

    async def simulate(pool: RolloutPool, case: Subject, engine: EngineSpec) -> dict[str, Any]:
        rollout = await case.on(engine.name).simulate(pool)
        tick()
        return _result(rollout)

    async def simulate_all() -> list[list[dict[str, Any]]]:
        async with RolloutPool(workers) as pool:
            each = (asyncio.gather(*(simulate(pool, case, e) for e in engines)) for case in cases)
            return await asyncio.gather(*each)

    results = asyncio.run(simulate_all())
    told = dict(zip((case.origin for case in cases), results, strict=True))
    return {
        "engines": [str(spec.identity) for spec in engines],
        "machines": [
            {"machine": case.origin, "task": case.task.name, "results": told[case.origin]}
            for case in known
        ],
        "families": [
            _rank(family, [told[case.origin] for case in drawn if case.task.family == family])
            for family in ranked_families()
        ],
        "note": " ".join(
            [*[NO_MACHINES] * (not known), missing_scipy("Rank correlations")]
        ).strip(),
    }


def require_several(engines: Sequence[EngineSpec]) -> Sequence[EngineSpec]:
    """The engines; raises ConfigError, which says what to install, if there is only one."""
    if len(engines) > 1:
        return engines
    has = f"only {engines[0].identity}" if engines else "none"
    others = [spec for spec in ENGINES.values() if spec not in engines]
    named = " or ".join(f"{spec.name} (pip install {spec.libraries[0]})" for spec in others)
    raise ConfigError(f"comparing needs two physics engines, but {has} is installed; add {named}")


def ranked_families() -> tuple[str, ...]:
    """The families whose procedural machines are ranked."""
    return tuple(name for name, family in FAMILIES.items() if family.ranked)


async def _draw_machines(count: int) -> list[Subject]:
    """This many different valid machines of the procedural designer per family, if it has them."""
    prompts, client = PromptSet(), ProceduralClient(0, [Designer.script])
    cases = []
    for family in ranked_families():
        task, found = get_task(family), dict[str, Machine]()
        for number in range(count):
            context = AskContext(client, prompts, Sampling(seed=number))
            given = Designer.sample(task.brief, LONE_ROOT)
            design = (await ask(Designer(), given, context, f"designer/{number}")).output
            if design is not None:
                found.setdefault(design.machine.digest, design.machine)
        cases += [
            Subject(machine, task, origin=f"{family} {digest}", recorded=True)
            for digest, machine in found.items()
        ]
    return cases


def _result(rollout: Rollout) -> dict[str, Any]:
    """Status, score, and the first break as `block` and `time`."""
    first = min(rollout.broken, key=lambda item: item.time, default=None)
    broken = first and {"block": first.block, "time": first.time}
    return {"status": rollout.status, "score": rollout.score, "first_break": broken}


def _rank(family: str, results: Iterable[Sequence[Mapping[str, Any]]]) -> dict[str, Any]:
    """Rank correlations over the machines that every engine could simulate."""
    simulated = [each for each in results if all(one["status"] == "ok" for one in each)]
    scores = [[one["score"] for one in each] for each in simulated]
    first, *others = zip(*scores, strict=True) if scores else ((), ())
    return {
        "family": family,
        "machines": len(simulated),
        "correlations": [rank_correlation(first, other) for other in others],
    }


def rank_correlation(first: Sequence[float], second: Sequence[float]) -> float | None:
    """Spearman's rank correlation coefficient; ties share their mean rank.

    Returns:
        -1 to 1; None if a series has fewer than two different values, or without scipy.
    """
    if len(set(first)) < 2 or len(set(second)) < 2 or not is_installed("scipy"):
        return None
    from scipy.stats import spearmanr

    return float(spearmanr(first, second).statistic)
