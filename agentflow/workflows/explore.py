"""The workflow `explore`: search for the best machine of every kind with MAP-Elites."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from random import Random

from agentflow.agents.querier import Querier
from agentflow.agents.refiner import Refiner
from agentflow.errors import BudgetSpentError
from agentflow.machine.brief import Brief
from agentflow.machine.edits.random import random_edit
from agentflow.machine.tree import Machine
from agentflow.runs.events import FLAWLESS, FirstAttempt
from agentflow.runs.locations import FEEDBACK, INITIAL, RANDOM_EDITS, Location
from agentflow.search.concurrency import run_concurrently
from agentflow.search.elites.archive import Archive, Cell
from agentflow.search.elites.map_elites import map_elites
from agentflow.search.node import Attempt, Evaluation, Node
from agentflow.search.settings import MAP_ELITES
from agentflow.workflows.base import Candidate, WorkflowResult
from agentflow.workflows.context import WorkflowContext
from agentflow.workflows.settings import Emitter, WorkflowSettings
from agentflow.workflows.stages import designs
from agentflow.workflows.stages.feedback import Revision, Trajectory
from agentflow.workflows.stages.pooled import draw_revision
from agentflow.workflows.stages.search_record import SearchRecorder
from agentflow.workflows.workflow import Workflow


class Emitters:
    """The `expand` and `evaluate` of one search.

    Each attempt draws its emitter, and what that draws, from a random stream of its own, so that
    the order in which models answer changes nothing.
    """

    def __init__(
        self, run: WorkflowContext, number: int, archive: Archive[Revision], rollouts: int
    ) -> None:
        """Work for the trajectory `number`; make at most `rollouts` new machines."""
        self.refiners = Trajectory(run, number)
        self.refiners.granted = {}  # no local trials: edits are an emitter of their own
        self._run, self._number, self._archive = run, number, archive
        self._left = rollouts
        self._seen = set[Machine]()

    async def expand(
        self, node: Node[Revision], labels: Sequence[str], earlier: Sequence[Attempt[Revision]]
    ) -> list[Attempt[Revision]]:
        """Make a machine per label, as long as rollouts are left."""
        self._seen.add(node.candidate.machine)
        labels = labels[: self._left]
        if not labels:
            raise BudgetSpentError("the rollouts of this search are used up")
        asked = [label for label in labels if self.emitter_of(label) == "refiner"]
        attempts = [self._draw(node, label) for label in labels if label not in asked]
        if asked:
            before = [item for item in earlier if self.emitter_of(item.label) == "refiner"]
            self.refiners.brief = self._aimed_brief(node, self._stream(f"{asked[0]}/aim"))
            attempts += await self.refiners.expand(node, asked, before)
        for attempt in attempts:
            if attempt.candidate is not None:
                self._count(attempt.candidate.machine)
        return sorted(attempts, key=lambda attempt: labels.index(attempt.label))

    def emitter_of(self, label: str) -> Emitter:
        """What makes the machine of an attempt."""
        return self._stream(label).choice(_emitters(self._run.settings))

    async def evaluate(self, revision: Revision, label: str) -> Evaluation:
        """Simulate a revision; the greatest score does not end a search for other kinds."""
        return replace(await self.refiners.evaluate(revision, label), perfect=False)

    def _count(self, machine: Machine) -> None:
        """Count a machine that will be simulated, once."""
        self._left -= machine not in self._seen
        self._seen.add(machine)

    def _draw(self, node: Node[Revision], label: str) -> Attempt[Revision]:
        """An edit or a crossover that leads to a new machine; without another elite, an edit."""
        emitter, brief = self.emitter_of(label), self._run.brief
        elites = self._archive.elites.values() if emitter == "crossover" else ()
        mates = [item.candidate.machine for item in elites if item.id != node.id]
        rng = self._stream(f"{label}/{emitter}")
        made = draw_revision(
            node.candidate.machine,
            mates,
            label,
            rng,
            brief,
            lambda machine, rng: random_edit(machine, rng, brief),
            lambda machine: machine not in self._seen,
        )
        if made.candidate is not None:
            self._count(made.candidate.machine)
        return made

    def _stream(self, label: str) -> Random:
        return self._run.stream(f"explore/traj-{self._number}/{label}")

    def _aimed_brief(self, node: Node[Revision], rng: Random) -> Brief:
        """The brief, with the kind of machine to aim at: an empty cell next to the node's."""
        brief, cell = self._run.brief, self._archive.cell_of(node)
        free = [] if cell is None else self._archive.empty_neighbours(cell)
        if cell is None or not free:
            return brief
        aim = self._describe_aim(cell, rng.choice(free))
        return replace(brief, objective=f"{brief.objective} {aim}")

    def _describe_aim(self, here: Cell, there: Cell) -> str:
        """What has to change to get from one cell to a neighbour."""
        ((axis, old, new),) = [
            change
            for change in zip(self._archive.axes, here, there, strict=True)
            if change[1] != change[2]
        ]
        return (
            f"Machines of other kinds are wanted too: make one whose {axis.name} is "
            f"{axis.describe(new)} instead of {axis.describe(old)}, with as high a score as "
            "possible."
        )


async def explore(run: WorkflowContext) -> WorkflowResult:
    """One first machine per trajectory, then a search with an archive of its own from each.

    First machines are random, or made by designers if refiners make new machines. The trajectories
    share `settings.max_simulations` evenly; reports merge their archives.
    """
    run.begin_stage(INITIAL)
    total = _rollouts(run.settings)
    numbers = list(run.trajectories)[:total]
    drawn = await designs.design_machines(run) if _asks_models(run.settings) else _draw(run)
    initial = run.end_stage(INITIAL, await designs.simulate(run, INITIAL, drawn[: len(numbers)]))
    left = total - initial.rollouts
    if run.is_over(initial) or left <= 0:
        return run.result()
    run.begin_stage(FEEDBACK)
    starts = initial.survivors
    shares = [left // len(starts) + (at < left % len(starts)) for at in range(len(starts))]
    searches = (_search(run, *item) for item in zip(starts, shares, strict=True))
    run.end_stage(FEEDBACK, await run_concurrently(searches))
    return run.result()


async def _search(run: WorkflowContext, start: Candidate, rollouts: int) -> Candidate:
    """Search from one machine; the result is the best of all its kinds."""
    assert start.machine is not None
    assert start.evaluation is not None
    archive = Archive[Revision]([item.axis for item in start.evaluation.measurements])
    emitters = Emitters(run, start.trajectory, archive, rollouts)
    recorder = SearchRecorder(run, Location(FEEDBACK, trajectory=start.trajectory))
    found = await map_elites(
        Revision(start.machine),
        replace(start.evaluation, perfect=False),
        emitters.expand,
        emitters.evaluate,
        run.settings.search,
        recorder,
        archive,
    )
    recorder.finish(found)
    best = found.nodes[found.best]
    asked = emitters.emitter_of("round-1/node-0/try-1") == "refiner"
    return Candidate(
        start.trajectory,
        best.candidate.machine,
        best.evaluation,
        first=emitters.refiners.first or FirstAttempt() if asked else FLAWLESS,
        edit=best.candidate.edit,
        search_cost=found.cost,
    )


def _draw(run: WorkflowContext) -> list[Candidate]:
    """The start machine, or else a random one, for each trajectory."""
    start = run.settings.start_machine
    return [
        designs.draw_machine(number, run.stream(f"traj-{number}"), run.brief, start=start)
        for number in run.trajectories
    ]


def _asks_models(settings: WorkflowSettings) -> bool:
    return "refiner" in _emitters(settings)


def _emitters(settings: WorkflowSettings) -> tuple[Emitter, ...]:
    return settings.emitters or ("edit", "crossover")


def _rollouts(settings: WorkflowSettings) -> int:
    search = settings.search
    return settings.max_simulations or settings.trajectories * (1 + search.rounds * search.width)


def _adapt(settings: WorkflowSettings) -> WorkflowSettings:
    """The rollouts end the search, not its rounds: each makes one new machine at least, or none."""
    total = _rollouts(settings)
    search = settings.search.model_copy(update={"strategy": MAP_ELITES, "rounds": total})
    return settings.model_copy(update={"max_simulations": total, "search": search})


def _calls(settings: WorkflowSettings) -> Mapping[str, int]:
    if not _asks_models(settings):
        return {}
    emitters = _emitters(settings)
    share = emitters.count("refiner") / len(emitters)
    edits = _rollouts(settings) - settings.trajectories
    calls = {**designs.count_designs(settings), Refiner.name: round(share * edits)}
    queried = settings.asks_querier * round(share * edits / settings.search.width)
    return {**calls, Querier.name: queried}


EXPLORE = Workflow(
    "explore",
    explore,
    calls=_calls,
    rollouts=_rollouts,
    adapt=_adapt,
    author=lambda settings: "" if _asks_models(settings) else RANDOM_EDITS,
)
