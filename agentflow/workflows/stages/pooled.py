"""A search over all machines of a run: designs, refinements and edits share one budget; and what
makes new machines without a model."""

from collections.abc import Awaitable, Callable, Sequence
from dataclasses import replace
from random import Random

from agentflow.agents.designer import Designer
from agentflow.agents.meta_designer import Blueprint
from agentflow.agents.refiner import Refiner
from agentflow.agents.registry import split_model, with_model
from agentflow.errors import UsageError
from agentflow.machine.brief import Brief
from agentflow.machine.edits.changes import cross
from agentflow.machine.edits.local import local_edit
from agentflow.machine.tree import Machine
from agentflow.runs.events import FLAWLESS, AnotherMechanismEvent
from agentflow.runs.locations import FEEDBACK, INITIAL, Location
from agentflow.search.node import Attempt, Node
from agentflow.search.pooled.pool import Branch, Choice, Pool, PooledStrategy, search_pool
from agentflow.search.registry import STRATEGIES
from agentflow.search.tree import SearchTree
from agentflow.workflows.base import Candidate, Maker, WorkflowResult
from agentflow.workflows.context import WorkflowContext
from agentflow.workflows.stages.designs import try_machines
from agentflow.workflows.stages.feedback import Revision, Trajectory
from agentflow.workflows.stages.search_record import SearchRecorder

MAX_REPEATS = 20
"""Maximum number of edits or crossovers that are drawn to find a new machine."""
Edit = Callable[[Machine, Random], Machine]
"""Applies one random legal edit; raises UsageError if there is none."""


def draw_revision(
    machine: Machine,
    mates: Sequence[Machine],
    label: str,
    rng: Random,
    brief: Brief,
    edit: Edit,
    is_new: Callable[[Machine], bool],
) -> Attempt[Revision]:
    """Make a new machine from one machine: a crossover if there are mates, or else an edit.

    Args:
        machine: What it is made from.
        mates: Machines to take a part of.
        label: Label of the attempt.
        rng: What is drawn from.
        brief: The task.
        edit: Makes an edit.
        is_new: Whether a machine has not been simulated yet.
    """
    note = "crossover" if mates else "random edit"
    for _ in range(MAX_REPEATS):
        try:
            made = cross(machine, rng.choice(mates), rng, brief) if mates else edit(machine, rng)
        except UsageError as error:
            return Attempt(label, None, str(error))
        if is_new(made):
            return Attempt(label, Revision(made, label=label), note)
    return Attempt(label, None, f"no {note} leads to a new machine")


Design = Callable[[int], Awaitable[Candidate]]
"""Number of a trajectory -> its first machine, not simulated yet."""
BlueprintOf = Callable[[int], Blueprint | None]
"""Number of a trajectory -> the plan that its first machine followed."""


class PooledSearch:
    """The first machines and the refinements of one search; a trajectory is one of its branches."""

    def __init__(self, run: WorkflowContext, design: Design, blueprint_of: BlueprintOf) -> None:
        """Search with `design` for first machines."""
        self.initial: list[Candidate] = []
        self._run, self._design = run, design
        self._blueprint_of = blueprint_of
        self._trajectories: dict[int, Trajectory] = {}
        self._recorders: dict[int, SearchRecorder] = {}
        most = 1 if run.settings.start else None  # a start machine takes the place of designs
        models = run.settings.model_arms or ("",)
        openers = [with_model(Designer.name, model) for model in models]
        arms = [
            with_model(arm, model)
            for arm in run.settings.arms
            for model in (models if arm == Refiner.name else ("",))
        ]
        free = [arm for arm in arms if not _refines(arm)]
        self._pool = Pool[Revision](openers, arms, most, "local trial", free)
        self._refined: dict[tuple[int, int], set[str]] = {}
        """(branch, node) -> labels of the attempts that refiners made."""
        self._proposed = set[str]()
        """Likeness of the machines of this search, simulated or about to be."""
        self._simulated: dict[str, Machine] = {}
        """Likeness -> first machine, of those of earlier rounds."""
        self._compared = set[Machine]()
        """The machines that have been compared with these."""

    async def search(self, strategy: PooledStrategy) -> list[Candidate]:
        """Search until the simulations of the run are used up; the best machine of each branch.

        Once the calls are used up, edits and crossovers go on.
        """
        run = self._run
        trials = run.brief.limits.trials
        with STRATEGIES.blaming(run.settings.search.strategy):
            await search_pool(
                self._pool,
                strategy,
                self._open,
                self._expand,
                self._left,
                run.settings.trajectories,
                run.stream("search"),
                opening_cost=trials,
                preparing=self._grant,
                questions=lambda: run.calls_left,
            )
        return [self._finish(branch) for branch in self._pool.branches if branch.tree is not None]

    @property
    def makers(self) -> tuple[Maker, ...]:
        """Who has made how many machines of the search, and what they gained."""
        gains = {**self._pool.records(), **self._pool.gains()}
        total = sum(map(len, gains.values()))
        return tuple(
            Maker(name, len(made), len(made) / total, sum(gain > 0 for gain in made), sum(made))
            for name, made in gains.items()
        )

    def _left(self) -> int:
        """The simulations that are left, as a round begins or ends; what has been learnt by then is
        shown in the next."""
        self._run.memory.reveal()
        for machine in [node.candidate.machine for _, node in self._pool.nodes]:
            if machine not in self._compared:
                self._compared.add(machine)
                self._simulated.setdefault(self._run.likeness(machine), machine)
        return self._run.simulations_left

    def _ask_for_another(self, number: int) -> None:
        """Ask the design of a branch for another mechanism, if the search prefers it to refining.

        It prefers a new design by drawing from its posteriors; that says something once machines
        have been refined.
        """
        refined = any(node.id for _, node in self._pool.nodes)
        if self._run.settings.another_mechanism and refined:
            avoided = self._run.memory.avoid(number)
            if avoided:
                self._run.note(AnotherMechanismEvent(Location(INITIAL, trajectory=number), avoided))

    async def _open(self, branch: Branch[Revision]) -> SearchTree[Revision] | None:
        run, number = self._run, branch.number
        run.models[number] = split_model(branch.arm)[1]
        self._ask_for_another(number)
        designed = await self._design(number)
        if designed.machine is not None:  # one that is known but for ids and sides counts as that
            same = self._simulated.get(run.likeness(designed.machine))
            designed = replace(designed, machine=same or designed.machine)
        (candidate,) = await try_machines(run, INITIAL, [designed])
        self.initial.append(candidate)
        if not candidate.valid or candidate.machine is None or candidate.evaluation is None:
            return None
        self._proposed.add(run.likeness(candidate.machine))
        trajectory = Trajectory(run, number, self._blueprint_of(number))
        trajectory.granted = {}
        trajectory.evaluations[candidate.machine] = candidate.evaluation
        place = Location(FEEDBACK, trajectory=number)
        recorder = SearchRecorder(run, place, names_nodes=True)
        recorder.begin(candidate.machine, candidate.evaluation)
        self._trajectories[number], self._recorders[number] = trajectory, recorder
        trials = candidate.trials
        return SearchTree(
            Revision(candidate.machine, None if trials.entries else candidate.edit, trials),
            candidate.evaluation,
            trajectory.expand,
            trajectory.evaluate,
            run.settings.search.request_rounds,
            recorder,
        )

    def _grant(self, choice: Choice, left: int) -> int:
        """Local trials of a machine before its refiner is asked: how many of what is left."""
        if not _refines(choice.arm):
            return 0
        return self._trajectories[choice.branch].grant(choice.node, left)

    async def _expand(
        self,
        branch: Branch[Revision],
        node: Node[Revision],
        asked: Sequence[tuple[str, str]],
        earlier: Sequence[Attempt[Revision]],
    ) -> Sequence[Attempt[Revision]]:
        attempts = [
            self._draw(branch, node, label, arm) for label, arm in asked if not _refines(arm)
        ]
        refined = {label: arm for label, arm in asked if _refines(arm)}
        if refined:
            self._trajectories[branch.number].asked.update(refined)
            tried = self._refined.setdefault((branch.number, node.id), set())
            before = [attempt for attempt in earlier if attempt.label in tried]
            tried.update(refined)
            attempts += await self._trajectories[branch.number].expand(node, [*refined], before)
        order = {label: number for number, (label, _) in enumerate(asked)}
        return sorted(attempts, key=lambda attempt: order.get(attempt.label, -1))

    def _draw(
        self, branch: Branch[Revision], node: Node[Revision], label: str, arm: str
    ) -> Attempt[Revision]:
        brief, machine = self._run.brief, node.candidate.machine
        others = [item.candidate.machine for _, item in self._pool.nodes] * (arm == "crossover")
        made = draw_revision(
            machine,
            [other for other in others if other != machine],
            label,
            self._run.stream(f"search/traj-{branch.number}/{label}"),
            brief,
            lambda machine, rng: local_edit(machine, rng, brief)[1],
            lambda made: self._run.likeness(made) not in self._proposed,
        )
        if made.candidate is not None:
            self._proposed.add(self._run.likeness(made.candidate.machine))
        return made

    def _finish(self, branch: Branch[Revision]) -> Candidate:
        """The best machine of a branch; its search is recorded as finished."""
        assert branch.tree is not None
        found = branch.tree.result(branch.tree.best())
        self._recorders[branch.number].finish(found)
        trajectory = self._trajectories[branch.number]
        return trajectory.finish(found, trajectory.first or FLAWLESS)


def _refines(arm: str) -> bool:
    """Whether a refiner is asked, of whatever model."""
    return split_model(arm)[0] == Refiner.name


async def search_all(
    run: WorkflowContext,
    strategy: PooledStrategy,
    design: Design,
    blueprint_of: BlueprintOf = lambda _: None,
) -> WorkflowResult:
    """Design and refine in one search; there is no blind refinement.

    The stage of first designs goes on as long as the search wants new ones.
    """
    run.begin_stage(FEEDBACK)
    found = PooledSearch(run, design, blueprint_of)
    searched = await found.search(strategy)
    run.makers = found.makers
    run.open_trajectories(len(found.initial))
    run.end_stage(INITIAL, found.initial)
    run.end_stage(FEEDBACK, searched)
    return run.result()
