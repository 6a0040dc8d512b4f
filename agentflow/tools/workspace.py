"""What the tools of one stage work on: the host, the machines, the budget, the submissions."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

from agentflow.machine.brief import Brief
from agentflow.machine.tree import Machine
from agentflow.machine.validity import problems_of
from agentflow.runs.locations import Location, StageName
from agentflow.tools.host import BenchHost, SimulationSummary, Told
from agentflow.tools.results import RefusedCall, StageEnded

NAME_LENGTH = 8
"""Digits of a machine's hash that are its name."""
MOST_MACHINES = 2000


@dataclass
class KnownMachine:
    """A machine that an agent can name."""

    name: str
    machine: Machine
    parent: str = ""
    """Name of the machine that it was made from; "" for one that was written from scratch."""
    script: str = ""
    note: str = ""
    """What its designer said of it."""
    submitted: StageName | None = None
    """The first stage in which it was submitted."""
    verified: bool = False
    """Whether its verification is paid for."""


class KnownMachines:
    """All machines of a run that an agent can name, oldest first; stages share them."""

    def __init__(self, most: int = MOST_MACHINES) -> None:
        """Keep at most so many machines."""
        self._most = most
        self._machines: dict[str, KnownMachine] = {}

    def __iter__(self) -> Iterator[KnownMachine]:
        return iter(self._machines.values())

    def __len__(self) -> int:
        return len(self._machines)

    def add(
        self, machine: Machine, parent: str = "", script: str = "", note: str = ""
    ) -> KnownMachine:
        """Give a machine a name; a known one keeps its parent and, without a new one, its note."""
        name = machine.digest[:NAME_LENGTH]
        if name in self._machines and self._machines[name].machine != machine:
            name = machine.digest
        if name not in self._machines:
            if len(self) >= self._most:
                raise RefusedCall(f"a run keeps at most {self._most} machines; continue with these")
            self._machines[name] = KnownMachine(name, machine, parent, script)
        known = self._machines[name]
        known.note = note or known.note
        return known

    def find(self, name: str) -> KnownMachine:
        """The machine of this name, or refuse with the names there are."""
        wanted = name.strip().lower()
        for known in self:
            if wanted in (known.name, known.machine.digest):
                return known
        newest = [known.name for known in self][:-6:-1]
        raise RefusedCall(
            f"there is no machine {name.strip()[:40]!r}; "
            + (f"the newest are {', '.join(newest)}" if newest else "there is none yet")
            + "; `check` and `edit` name machines, `history` lists them"
        )


def require_complete(machine: Machine, brief: Brief) -> None:
    """Refuse a machine that cannot be simulated as it is."""
    for problem in problems_of(machine, brief):
        raise RefusedCall(
            f"this machine is not complete: {problem.message}; `edit` it", problem.code
        )


def _result(found: SimulationSummary | BaseException) -> SimulationSummary:
    """What a simulation found, or raise its error."""
    if isinstance(found, BaseException):
        raise found
    return found


@dataclass
class Allowance:
    """A number of uses of one kind."""

    noun: str
    """What is used, such as "simulation"."""
    instead: str
    """What still works once all are used."""
    left: int
    total: int

    @classmethod
    def of_simulations(cls, total: int) -> Allowance:
        """An allowance of simulations, of which nothing is used yet."""
        return cls("simulation", "`submit` takes any machine that has been simulated", total, total)

    @classmethod
    def of_pictures(cls, total: int) -> Allowance:
        """An allowance of pictures, of which nothing is used yet."""
        return cls("picture", "`look` without a time costs nothing", total, total)

    def take(self, number: int = 1) -> None:
        """Use this many, or refuse."""
        if number and self.left <= 0:
            raise RefusedCall(
                f"all {self.total} {self.noun}s are used; the other tools still work, and "
                f"{self.instead}"
            )
        if number > self.left:
            are = "is" if self.left == 1 else "are"
            raise RefusedCall(f"this takes {number} {self.noun}s, and {self.left} {are} left")
        self.left -= number

    def give_back(self, number: int = 1) -> None:
        """Return some that were not used after all."""
        self.left += number

    @contextmanager
    def using(self, number: int = 1) -> Iterator[None]:
        """Use some, unless the work fails or is cancelled."""
        self.take(number)
        try:
            yield
        except BaseException:
            self.give_back(number)
            raise

    def __str__(self) -> str:
        return f"{self.left} of {self.total} {self.noun}s left"


@dataclass
class StageBudget:
    """What an agent may spend in one stage."""

    submissions: int
    """Machines that it may submit; the last one ends the stage."""
    simulations: Allowance | None = None
    """Simulations, shared by the stages of a run; None in a stage without simulation."""
    pictures: Allowance | None = None
    """Pictures, shared by the stages of a run; None without vision."""
    stages_left: int = 0
    """Stages that follow, which start from the machines of this one."""


@dataclass(frozen=True)
class Call:
    """One call of a tool: where it works, and its location in the run."""

    workspace: Workspace
    location: Location
    recorded: bool = True


@dataclass
class Workspace:
    """The state of one stage: what its tools read and change."""

    host: BenchHost
    stage: StageName
    budget: StageBudget
    machines: KnownMachines
    submitted: list[Machine] = field(default_factory=list)
    ended: asyncio.Event = field(default_factory=asyncio.Event)
    _waiting: Counter[Machine] = field(default_factory=Counter)
    """Calls that wait for the simulation of a machine."""

    def name(
        self, machine: Machine, parent: str = "", script: str = "", note: str = ""
    ) -> KnownMachine:
        """Give a machine a name and save it."""
        known = self.machines.add(machine, parent, script, note)
        self.host.save(machine)
        return known

    def result_of(self, machine: Machine) -> SimulationSummary | None:
        """The simulation of a machine, as far as this stage may know it."""
        return None if self.budget.simulations is None else self.host.simulated(machine)

    async def simulate(
        self, machines: Sequence[Machine], location: Location
    ) -> list[SimulationSummary]:
        """Simulate different machines at once.

        New ones are charged to the budget, all or none, unless every call for one is cancelled.
        """
        simulations = self.budget.simulations
        if simulations is None:
            raise RefusedCall("this stage has no simulation; submit what you think is best")
        new = [m for m in machines if self.result_of(m) is None and not self._waiting[m]]
        simulations.take(len(new))
        self._waiting.update(machines)
        places = [location]  # which names its machine if one of several is simulated again
        if len(machines) > 1:
            places = [replace(location, candidate=n) for n in range(1, len(machines) + 1)]
        try:
            jobs = map(self.host.simulate, machines, places)
            found = await asyncio.gather(*jobs, return_exceptions=True)
        finally:
            self._waiting.subtract(machines)
            unused = [m for m in machines if not self._waiting[m] and self.result_of(m) is None]
            simulations.give_back(len(unused))
        return [_result(each) for each in found]

    async def verify(self, known: KnownMachine) -> tuple[Told, int]:
        """Verify a simulated machine, and charge its simulations unless it was verified before;
        also how many those were."""
        simulations = self.budget.simulations
        assert simulations is not None, "only simulated machines are verified"
        cost = 0 if known.verified else self.host.evaluator.count_changes(known.machine)
        if cost > simulations.left:
            raise RefusedCall(
                f"verifying machine {known.name} takes {cost} simulations, and {simulations.left} "
                "are left; `submit` it: the best machine is verified in the end"
            )
        with simulations.using(cost):
            told = await self.host.evaluator.verified(known.machine)
        if told.data["score"] is None or (cost and known.verified):
            simulations.give_back(cost)
            cost = 0
        known.verified = told.data["score"] is not None
        return told, cost

    def charge_changes(self, known: KnownMachine) -> None:
        """Charge a verification that an earlier process has made."""
        if self.budget.simulations and not known.verified:
            self.budget.simulations.take(self.host.evaluator.count_changes(known.machine))
            known.verified = True

    def require_submittable(self, known: KnownMachine) -> None:
        """Refuse a machine that has been submitted, and any once the stage has ended."""
        if self.ended.is_set():
            raise StageEnded
        if known.machine in self.submitted:
            raise RefusedCall(f"machine {known.name} is already submitted; submit another one")

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
        text = f"{self.host.brief_text.rstrip()}\n\n## Budget\n{self.budget_text}\n{self._rules}"
        names = ", ".join(known.name for known in self.machines)
        return f"{text}\nMachines so far: {names}" if names else text

    @property
    def _rules(self) -> str:
        """What becomes of submitted machines."""
        budget = self.budget
        told = (
            "Submitting a machine that has not been simulated uses a simulation."
            if budget.simulations
            else "Machines that you submit are simulated once this stage is over."
        )
        aims = self.host.evaluator.aims
        told += f" A good score is {aims.good:g}." if aims.good is not None else ""
        told += f" The best known one is {aims.record:g}." if aims.record is not None else ""
        more = f"{budget.stages_left} more stage{'s' * (budget.stages_left > 1)}"
        follow = f" {more} will start from all machines so far." if budget.stages_left else ""
        return f"{told} {self._final_score}{follow}{self._trial_rule}"

    @property
    def _final_score(self) -> str:
        """Which machine counts, and how."""
        aims = self.host.evaluator.aims
        if not aims.most_changes:
            return "The best submitted machine is the result."
        now = " `verify` does this now, at their cost; for the result, it is free."
        now *= self.budget.simulations is not None
        return (
            "The best submitted machine is the result. Its final score is the median of its "
            f"simulation and up to {aims.most_changes} with small changes ({aims.changes}).{now}"
        )

    @property
    def _trial_rule(self) -> str:
        """What takes the place of the trials that revise controls in other workflows."""
        if self.host.brief.limits.trials <= 1:
            return ""
        return (
            "\nHere, no trials revise the controls: a machine with other controls is another "
            "machine, which `edit` makes and `simulate` tries."
        )

    @property
    def budget_text(self) -> str:
        """What is left, in one sentence."""
        budget = self.budget
        left = budget.submissions - len(self.submitted)
        parts = [f"{left} of {budget.submissions} submissions left"]
        parts.append(str(budget.simulations or "no simulation in this stage"))
        if budget.pictures:
            parts.append(str(budget.pictures))
        return f"Stage {self.stage}: {', '.join(parts)}."

    @property
    def budget_data(self) -> dict[str, object]:
        """The same as data; None for what this stage does not have."""
        budget = self.budget
        return {
            "stage": self.stage,
            "submissions_left": budget.submissions - len(self.submitted),
            "simulations_left": budget.simulations and budget.simulations.left,
            "pictures_left": budget.pictures and budget.pictures.left,
        }
