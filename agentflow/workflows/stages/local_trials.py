"""Local trials: single edits of a machine, simulated before its refiner is asked.

They tell the refiner which way is up. They are drawn from the run's seed and fixed in number, so
that a run replays; the best joins the search, if it is better than what was edited.
"""

from dataclasses import dataclass, replace

from agentflow.machine.edits.difference import edit_text
from agentflow.machine.tree import Machine
from agentflow.runs.events import LocalTrial, LocalTrialsEvent
from agentflow.runs.locations import Location
from agentflow.search.concurrency import run_concurrently
from agentflow.search.node import Evaluation
from agentflow.search.tree import is_better
from agentflow.tools.exploring import EditTrial, trials_text
from agentflow.workflows.context import WorkflowContext


@dataclass(frozen=True)
class Tried:
    """One edit of a node's machine and what it did."""

    label: str
    """Where it was simulated, relative to the search."""
    edit: str
    """As commands, or in words."""
    machine: Machine
    evaluation: Evaluation


@dataclass(frozen=True)
class Explored:
    """What the local trials of a machine showed."""

    text: str = ""
    """For its refiner; "" without any."""
    gain: Tried | None = None
    """The best, if it is better than the machine."""


async def explore(
    run: WorkflowContext, where: Location, machine: Machine, base: Evaluation, edited: list[Machine]
) -> Explored:
    """Simulate machines that one edit made.

    Args:
        run: The run.
        where: Trajectory and node of the machine.
        machine: What was edited.
        base: Its evaluation.
        edited: The new machines.
    """
    places = [replace(where, candidate=number) for number in range(1, len(edited) + 1)]
    found = await run_concurrently(map(run.evaluate, edited, places))
    tried = [
        Tried(
            str(Location(candidate=place.candidate, node=place.node)),
            edit_text(machine, new, run.brief),
            new,
            evaluation,
        )
        for place, new, evaluation in zip(places, edited, found, strict=True)
    ]
    gain: Tried | None = None
    for each in tried:
        if is_better(each.evaluation, gain.evaluation if gain else base):
            gain = each
    told = [
        EditTrial(t.edit, t.evaluation.reward, bool(t.evaluation.details.broken)) for t in tried
    ]
    text = trials_text(base.reward, bool(base.details.broken), told)
    rows = tuple(LocalTrial(t.edit, t.machine.digest, t.evaluation.score) for t in tried)
    run.note(LocalTrialsEvent(where, machine.digest, base.score, rows, text))
    return Explored(text, gain)
