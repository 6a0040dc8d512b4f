"""The workflow `tune`: better numbers of what controls a machine, whose structure stays."""

from collections.abc import Sequence
from dataclasses import replace

from agentflow.errors import ConfigError
from agentflow.machine.numbers import machine_numbers, with_numbers
from agentflow.machine.tree import Machine
from agentflow.runs.events import FLAWLESS, EditEvent
from agentflow.runs.locations import FEEDBACK, INITIAL, Location
from agentflow.search.concurrency import run_concurrently
from agentflow.search.tree import is_better
from agentflow.search.tuning import Cma, require_cma
from agentflow.search.tuning import tune as search
from agentflow.workflows.base import Candidate, WorkflowResult
from agentflow.workflows.context import WorkflowContext
from agentflow.workflows.settings import WorkflowSettings
from agentflow.workflows.stages.designs import simulate
from agentflow.workflows.workflow import Workflow, refuse_program

SIMULATIONS = 100
"""Simulations of a run by default, the first one of the machine included."""


async def tune(run: WorkflowContext) -> WorkflowResult:
    """Simulate the start machine, then what CMA-ES makes of its numbers."""
    start, window = run.settings.start_machine, run.brief.limits.controls
    assert start is not None
    assert window is not None, "machines without controls are refused before, and by the task"
    run.begin_stage(INITIAL)
    first = Candidate(1, start, first=FLAWLESS)
    initial = run.end_stage(INITIAL, await simulate(run, INITIAL, [first]))
    if run.is_over(initial) or run.simulations_left <= 0:
        return run.result()
    run.begin_stage(FEEDBACK)
    best = initial.survivors[0]
    assert best.evaluation is not None

    async def judge(machines: Sequence[Machine], generation: int) -> list[float | None]:
        nonlocal best
        places = [
            Location(FEEDBACK, trajectory=1, candidate=number, round=generation)
            for number in range(1, len(machines) + 1)
        ]
        found = await run_concurrently(map(run.evaluate, machines, places))
        for machine, place, evaluation in zip(machines, places, found, strict=True):
            assert best.evaluation is not None
            kept = is_better(evaluation, best.evaluation)
            run.note(EditEvent(place, start.digest, machine.digest, kept))
            if kept:
                best = replace(best, machine=machine, evaluation=evaluation)
        return [item.reward for item in found]

    source = Cma(machine_numbers(start, window), run.stream("tune").getrandbits(32))
    await search(
        source,
        lambda values: with_numbers(start, values, window),
        judge,
        start,
        best.evaluation.reward,
        run.simulations_left,
        run.brief.greatest,
    )
    run.end_stage(FEEDBACK, [best])
    return run.result()


def _require(settings: WorkflowSettings) -> None:
    """Raise ConfigError unless cma is installed and there is a machine with numbers to tune."""
    refuse_program(settings)
    require_cma()
    start = settings.start_machine
    if start is None:
        raise ConfigError("the workflow tune changes a machine: name it with --start")
    if not machine_numbers(start, 1.0):
        raise ConfigError(
            "this machine has no numbers to tune, because it brings no controls: add some, as in "
            '{"blocks": [...], "controls": [{"group": "motors", "at": 0, "for": 5, "level": 1}]}'
        )


def _adapt(settings: WorkflowSettings) -> WorkflowSettings:
    most = settings.max_simulations or SIMULATIONS
    return settings.model_copy(update={"trajectories": 1, "max_simulations": most})


TUNE = Workflow(
    "tune",
    tune,
    calls=lambda _: {},
    rollouts=lambda settings: settings.max_simulations or SIMULATIONS,
    adapt=_adapt,
    author=lambda _: "none (CMA-ES)",
    require=_require,
    stores=True,
)
