"""Local trials: single edits of a machine, simulated before its refiner is asked.

They tell the refiner which way is up. They are drawn from the run's seed and fixed in number, so
that a run replays; a good one can itself be the result.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from agentflow.machine.edits.difference import edit_text
from agentflow.machine.tree import Machine
from agentflow.runs.events import LocalTrial, LocalTrialsEvent
from agentflow.runs.locations import FEEDBACK, Location
from agentflow.search.concurrency import run_concurrently
from agentflow.search.node import Evaluation
from agentflow.search.tree import is_better
from agentflow.tools.exploring import EditTrial, trials_text
from agentflow.workflows.base import SimulationSummary
from agentflow.workflows.context import WorkflowContext


@dataclass(frozen=True)
class Tried:
    """One edit and what it did."""

    edit: str
    """As commands, or in words."""
    machine: Machine
    evaluation: Evaluation


class LocalTrials:
    """Those of the machines of one trajectory."""

    def __init__(self, run: WorkflowContext, trajectory: int) -> None:
        self.best: Tried | None = None
        """The best of all."""
        self._run, self._trajectory = run, trajectory

    async def carry_out(
        self, machine: Machine, base: Evaluation, node: int, edited: Sequence[Machine]
    ) -> str:
        """Simulate machines that one edit made, and tell what the edits did; "" without any.

        Args:
            machine: What was edited, a node of the search.
            base: Its evaluation.
            node: Its id.
            edited: The new machines.
        """
        if not edited:
            return ""
        run = self._run
        places = [
            Location(FEEDBACK, trajectory=self._trajectory, candidate=number, node=node)
            for number in range(1, len(edited) + 1)
        ]
        found = await run_concurrently(map(run.evaluate, edited, places))
        tried = [
            Tried(edit_text(machine, new, run.brief), new, evaluation)
            for new, evaluation in zip(edited, found, strict=True)
        ]
        for each in tried:
            if self.best is None or is_better(each.evaluation, self.best.evaluation):
                self.best = each
        told = [EditTrial(t.edit, t.evaluation.reward, _breaks(t.evaluation)) for t in tried]
        text = trials_text(base.reward, _breaks(base), told)
        rows = tuple(LocalTrial(t.edit, t.machine.digest, t.evaluation.score) for t in tried)
        where = Location(FEEDBACK, trajectory=self._trajectory, node=node)
        run.note(LocalTrialsEvent(where, machine.digest, base.score, rows, text))
        return text


def _breaks(evaluation: Evaluation) -> bool:
    summary: SimulationSummary = evaluation.details
    return bool(summary.broken)
