"""What the tools of one stage work on: the world, the machines, the budget, the submissions."""

from __future__ import annotations

import asyncio
from collections import Counter
from dataclasses import dataclass, field

from agentflow.machine.tree import Machine
from agentflow.runs.places import Place, StageName
from agentflow.tools.budget import Budget
from agentflow.tools.machines import KnownMachine, KnownMachines
from agentflow.tools.results import Refused, StageEnded
from agentflow.tools.world import Simulation, World


@dataclass(frozen=True)
class Call:
    """One call of a tool: where it works, and its place in the run."""

    desk: Desk
    place: Place


@dataclass
class Desk:
    """The state of one stage."""

    world: World
    stage: StageName
    budget: Budget
    machines: KnownMachines
    submitted: list[Machine] = field(default_factory=list)
    ended: asyncio.Event = field(default_factory=asyncio.Event)
    _waiting: Counter[Machine] = field(default_factory=Counter)
    """Calls that wait for the simulation of a machine."""

    def name(self, machine: Machine, parent: str = "", script: str = "") -> KnownMachine:
        """Give a machine a name and save it."""
        known = self.machines.add(machine, parent, script)
        self.world.save(machine)
        return known

    def result_of(self, machine: Machine) -> Simulation | None:
        """The simulation of a machine, as far as this stage may know it."""
        return None if self.budget.rollouts is None else self.world.simulated(machine)

    async def simulate(self, machine: Machine, place: Place) -> Simulation:
        """Simulate a machine; a new one is charged to the budget unless every call is cancelled."""
        rollouts = self.budget.rollouts
        if rollouts is None:
            raise Refused("this stage has no simulation; submit what you think is best")
        if self.result_of(machine) is None and not self._waiting[machine]:
            rollouts.take()
        self._waiting[machine] += 1
        try:
            return await self.world.simulate(machine, place)
        finally:
            self._waiting[machine] -= 1
            if not self._waiting[machine] and self.result_of(machine) is None:
                rollouts.give_back()

    def require_submittable(self, known: KnownMachine) -> None:
        """Refuse a machine that has been submitted, and any once the stage has ended."""
        if self.ended.is_set():
            raise StageEnded
        if known.machine in self.submitted:
            raise Refused(f"machine {known.name} is already submitted; submit another one")

    def submit(self, known: KnownMachine, last: bool) -> None:
        """Add a submission, unless another call was faster; the last one ends the stage."""
        self.require_submittable(known)
        self.submitted.append(known.machine)
        known.submitted = known.submitted or self.stage
        if last or len(self.submitted) >= self.budget.submissions:
            self.ended.set()

    @property
    def brief_text(self) -> str:
        """The task, what is left of the budget, and the names of the machines so far."""
        text = f"{self.world.brief_text.rstrip()}\n\n## Budget\n{self.budget_text}\n{self._rules}"
        names = ", ".join(known.name for known in self.machines)
        return f"{text}\nMachines so far: {names}" if names else text

    @property
    def _rules(self) -> str:
        """What becomes of submitted machines."""
        budget = self.budget
        told = (
            "Submitting a machine that has not been simulated uses a simulation."
            if budget.rollouts
            else "Machines that you submit are simulated once this stage is over."
        )
        more = f"{budget.stages_left} more stage{'s' * (budget.stages_left > 1)}"
        follow = f" {more} will start from all machines so far." if budget.stages_left else ""
        return f"{told} The best machine of all stages is the result.{follow}"

    @property
    def budget_text(self) -> str:
        """What is left, in one sentence."""
        budget = self.budget
        left = budget.submissions - len(self.submitted)
        parts = [f"{left} of {budget.submissions} submissions left"]
        parts.append(str(budget.rollouts) if budget.rollouts else "no simulation in this stage")
        if budget.looks:
            parts.append(str(budget.looks))
        return f"Stage {self.stage}: {', '.join(parts)}."

    @property
    def budget_data(self) -> dict[str, object]:
        """The same as data; None for what this stage does not have."""
        budget = self.budget
        return {
            "stage": self.stage,
            "submissions_left": budget.submissions - len(self.submitted),
            "rollouts_left": budget.rollouts and budget.rollouts.left,
            "looks_left": budget.looks and budget.looks.left,
        }
