"""The feedback loop: one search per trajectory, whose nodes are machines with feedback.

Feedback is the simulation's report and the answers to one querier per node.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from agentflow.agents.history import EditRecord, History
from agentflow.agents.meta_designer import Blueprint
from agentflow.agents.querier import Querier, QuerierInput
from agentflow.agents.refiner import Refiner, RefinerInput
from agentflow.errors import BudgetSpentError, PluginError
from agentflow.machine.edits.difference import matching_ids, renumbering
from agentflow.machine.edits.local import local_edits
from agentflow.machine.tree import Machine
from agentflow.runs.events import FirstAttempt
from agentflow.runs.locations import FEEDBACK, Location
from agentflow.search.concurrency import run_concurrently
from agentflow.search.node import Attempt, Evaluation, Node, SearchResult
from agentflow.search.registry import STRATEGIES
from agentflow.search.strategies import extras
from agentflow.tools.host import SimulationSummary
from agentflow.workflows.base import Candidate
from agentflow.workflows.context import WorkflowContext
from agentflow.workflows.stages import designs
from agentflow.workflows.stages.local_trials import Explored, Tried, explore
from agentflow.workflows.stages.search_record import SearchRecorder

TWIN = (
    "this machine differs from one that was simulated only in the numbers of its blocks, or is its "
    "mirror image: make a different change"
)


@dataclass(frozen=True)
class Revision:
    """A machine in a search and how it was made; revisions of the same machine are equal."""

    machine: Machine
    edit: EditRecord | None = field(default=None, compare=False)
    """The refinement that made it; its score is not known yet."""
    history: History = field(default=History(), compare=False)
    """Edits that led to the machine that was refined, in its numbering."""
    label: str = field(default="", compare=False)
    """Label of the attempt that made it; distinguishes revisions of the same machine."""

    @property
    def is_edited(self) -> bool:
        """Whether it differs from the machine that was designed."""
        return self.edit is not None or bool(self.history.entries)


@dataclass
class _Shown:
    """What refiners see of a node under expansion, and what was known as it began."""

    history: History
    known: dict[Machine, str]
    """Machine -> its likeness."""
    views: tuple[str, ...] = ()


async def feedback_loop(
    run: WorkflowContext, candidate: Candidate, blueprint: Blueprint | None, *, model_role: str = ""
) -> Candidate:
    """Search from a trajectory's valid machine; returns the best machine of the tree.

    `model_role` is the role whose model and sampling refine, if not the refiner's own.
    """
    numbers = run.settings.search
    assert candidate.machine is not None
    assert candidate.evaluation is not None
    trajectory = Trajectory(run, candidate.trajectory, blueprint, model_role)
    recorder = SearchRecorder(run, Location(FEEDBACK, trajectory=candidate.trajectory))
    recorder.begin(candidate.machine, candidate.evaluation)
    trials = candidate.trials
    root = Revision(candidate.machine, None if trials.entries else candidate.edit, trials)
    more = extras(numbers, run.stream(f"strategy/traj-{candidate.trajectory}"))
    with STRATEGIES.blaming(numbers.strategy):
        found = await STRATEGIES[numbers.strategy](
            root,
            candidate.evaluation,
            trajectory.expand,
            trajectory.evaluate,
            numbers,
            recorder,
            **more,
        )
    if not isinstance(found, SearchResult):
        raise PluginError(
            f"{STRATEGIES.describe(numbers.strategy)} must return a SearchResult, such as "
            f"tree.result(tree.best()), not {type(found).__name__}"
        )
    recorder.finish(found)
    nothing_to_do = found.perfect and not found.cost.attempts
    first = candidate.first if nothing_to_do else trajectory.first or FirstAttempt()
    return trajectory.finish(found, first)


class Trajectory:
    """How the search of one trajectory expands a node and evaluates a revision."""

    def __init__(
        self,
        run: WorkflowContext,
        number: int,
        blueprint: Blueprint | None = None,
        model_role: str = "",
    ) -> None:
        self.first: FirstAttempt | None = None
        """How far the first attempt of the search got; None if no refiner was asked."""
        self.brief = run.brief
        """The task as refiners see it; a search may set an aim of its own."""
        self._run, self._blueprint, self._model_role = run, blueprint, model_role
        self._number = number
        self.asked: dict[str, str] = {}
        """Label of an attempt -> role whose model makes it, where a search chooses that."""
        self._queried: dict[int, str] = {}
        """Node id -> answers to its querier's queries."""
        self._tried: dict[str, list[Attempt[Revision]]] = {}
        """Label of a revision -> attempts to refine it, over all its expansions."""
        self.evaluations: dict[Machine, Evaluation] = {}
        """Of all machines of this trajectory that revisions may make, its first one included."""
        self._first_label = ""
        self._shown: dict[int, _Shown] = {}
        """By the id of a node under expansion. A search over the whole run expands several nodes of
        a trajectory at once."""
        self.granted: dict[int, int] | None = None
        """Id of a node -> local trials of its machine, where a search deals them; None: as many as
        the settings say."""
        self._explored: dict[int, Explored] = {}
        """Id of a node -> what the local trials of its machine showed."""
        self._known: dict[Machine, str] = {}
        """Machine -> its likeness; of nodes, local trials and what refiners made."""

    def finish(self, found: SearchResult[Revision], first: FirstAttempt) -> Candidate:
        """The best machine of its search."""
        best = found.nodes[found.best]
        return Candidate(
            self._number,
            best.candidate.machine,
            best.evaluation,
            first=first,
            edit=best.candidate.edit,
            search_cost=found.cost,
        )

    async def evaluate(self, revision: Revision, label: str) -> Evaluation:
        """Simulate a revision."""
        found = await self._run.evaluate(revision.machine, self._location(FEEDBACK, label))
        self.evaluations[revision.machine] = found
        return found

    async def expand(
        self, node: Node[Revision], labels: Sequence[str], earlier: Sequence[Attempt[Revision]]
    ) -> list[Attempt[Revision]]:
        """Ask refiners once about a node; they see the results of earlier requests.

        The best local trial comes with their attempts, if it is better than the node.
        """
        self.evaluations[node.candidate.machine] = node.evaluation
        made = {attempt.candidate.machine for attempt in earlier if attempt.candidate}
        waiting = sum(not self._run.has_tried(self._number, machine) for machine in made)
        labels = labels[: max(0, self._run.left_in(self._number) - waiting)]
        if not labels:
            raise BudgetSpentError("the simulations of this trajectory are used up")
        self._first_label = self._first_label or labels[0]
        gained: list[Attempt[Revision]] = []
        if not earlier:
            await self._run.memory.step(self._number)
            left = self._run.left_in(self._number) - waiting - len(labels)
            gain = await self._prepare(node, left)
            if gain is not None:
                gained = [Attempt(gain.label, self._adopted(node, gain), gain.edit)]
            if gain is not None and gain.evaluation.perfect:
                return [replace(gained[0], label=label) for label in labels]
        given = await self._given(node, earlier)
        answers = await run_concurrently(self._refine(node, given, label) for label in labels)
        attempts = [answer for answer in answers if answer is not None]
        if not attempts and not gained:
            raise self._run.spent or BudgetSpentError("the budget has run out")
        attempts = gained + self._without_twins(node, earlier, attempts)
        self._tried.setdefault(node.candidate.label, []).extend(attempts)
        return attempts

    def grant(self, node: int, left: int) -> int:
        """Plan the local trials of a node, once, with what a search has left; their number."""
        assert self.granted is not None
        if node in self._explored or node in self.granted:
            return 0
        most = self.granted[node] = min(self._run.settings.local_trials, left)
        return most

    def _adopted(self, node: Node[Revision], gain: Tried) -> Revision:
        """The machine of a local trial as a child of what was edited."""
        before = node.candidate.machine
        edit = EditRecord(
            gain.edit.replace("; ", "\n"),
            "Success",
            before=node.evaluation.score,
            facts=(node.evaluation.details.facts, {}),
            ids=renumbering(before, matching_ids(before, gain.machine), {}),
        )
        return Revision(gain.machine, edit, self._shown[node.id].history, gain.label)

    async def _prepare(self, node: Node[Revision], left: int) -> Tried | None:
        """What refiners see of a node; the querier is asked while local trials run. Returns the
        best of these, if it is better than the node.

        Args:
            node: What is about to be refined.
            left: How many machines the trials may simulate at most.
        """
        run, machine = self._run, node.candidate.machine
        self._known[machine] = run.likeness(machine)
        edited = self._draw_edits(node, left)
        shown = self._shown[node.id] = _Shown(self._history_of(node), dict(self._known))
        await run_concurrently((self._query(node), self._explore(node, edited)))
        shown.views = await run.views(machine)
        return self._explored[node.id].gain if edited else None

    async def _query(self, node: Node[Revision]) -> None:
        """Ask the querier about a node, once; "" if it gives no valid reply or asks nothing."""
        run, machine = self._run, node.candidate.machine
        if not run.settings.asks_querier or node.id in self._queried:
            return
        given = QuerierInput(
            **run.role_input, machine=machine, score=node.evaluation.score, feedback=_feedback(node)
        )
        location = Location(Querier.name, trajectory=self._number, node=node.id)
        outcome = await run.ask(Querier(), given, location, stage=FEEDBACK)
        queries = outcome and outcome.output
        told = (await run.query(machine, queries, location)).text if queries else ""
        self._queried[node.id] = told

    async def _explore(self, node: Node[Revision], edited: list[Machine]) -> None:
        """Simulate the machines of the local trials of a node."""
        if edited:
            where = Location(FEEDBACK, trajectory=self._number, node=node.id)
            machine = node.candidate.machine
            self._explored[node.id] = await explore(
                self._run, where, machine, node.evaluation, edited
            )

    def _draw_edits(self, node: Node[Revision], left: int) -> list[Machine]:
        """The machines of the local trials of a node; none if it had some.

        They are drawn before anything is waited for, so that they depend on no answer.
        """
        run = self._run
        most = min(left, run.settings.local_trials)
        if self.granted is not None:
            most = self.granted.get(node.id, 0)
        if most <= 0 or node.id in self._explored:
            return []
        rng = run.stream(f"local-trials/traj-{self._number}/node-{node.id}")
        return local_edits(node.candidate.machine, rng, run.brief, most, self._is_new)

    def _is_new(self, machine: Machine) -> bool:
        """Whether a machine differs from known ones in more than its ids and sides; then it is
        known."""
        form = self._run.likeness(machine)
        if form in self._known.values():
            return False
        self._known[machine] = form
        return True

    def _without_twins(
        self,
        node: Node[Revision],
        earlier: Sequence[Attempt[Revision]],
        attempts: Sequence[Attempt[Revision]],
    ) -> list[Attempt[Revision]]:
        """Refuse machines that differ from known ones only in the ids of their blocks, or that are
        their mirror images.

        Known are those from before the expansion and its own, which no order of answers changes.
        """
        known = dict(self._shown[node.id].known)
        kept: list[Attempt[Revision]] = []
        for attempt in (*earlier, *attempts):
            machine = attempt.candidate.machine if attempt.candidate else None
            if machine is not None and machine not in known:
                form = self._run.likeness(machine)
                if form in known.values():
                    attempt = Attempt(attempt.label, None, TWIN)
                else:
                    known[machine] = self._known[machine] = form
            kept.append(attempt)
        return kept[len(earlier) :]

    async def _refine(
        self, node: Node[Revision], given: RefinerInput, label: str
    ) -> Attempt[Revision] | None:
        location = self._location("refiner/feedback", label)
        outcome = await self._run.ask(
            Refiner(),
            given,
            location,
            stage=FEEDBACK,
            model_role=self.asked.get(label, self._model_role),
            once=True,
        )
        if outcome is None:
            return None
        if label == self._first_label:
            self.first = designs.first_attempt_of(outcome)
        if outcome.output is None:
            return Attempt(label, None, designs.failure_reason(outcome))
        edit = designs.edit_record(outcome.output, node.evaluation)
        revision = Revision(outcome.output.machine, edit, self._shown[node.id].history, label)
        return Attempt(label, revision, edit.script)

    def _location(self, name: str, label: str) -> Location:
        """Turn a label of the search into a location in this trajectory."""
        return replace(Location.parse(label), name=name, trajectory=self._number)

    async def _given(
        self, node: Node[Revision], earlier: Sequence[Attempt[Revision]]
    ) -> RefinerInput:
        settings, shown = self._run.settings, self._shown[node.id]
        told = "" if settings.feedback == "score_only" else _feedback(node)
        return RefinerInput(
            **self._run.role_input | {"brief": self.brief},
            machine=node.candidate.machine,
            blueprint=None if node.candidate.is_edited else self._blueprint,
            history=shown.history if settings.history else History(),
            score=node.evaluation.score,
            feedback=told,
            trials=self._explored.get(node.id, Explored()).text,
            queried=self._queried.get(node.id, ""),
            earlier=tuple(_verdict(attempt) for attempt in earlier),
            format=settings.refinement,
            images=shown.views,
            elsewhere=await self._run.elsewhere(self._number),
        )

    def _history_of(self, node: Node[Revision]) -> History:
        """The edits that led to the node, and those already tried on it, in its numbering."""
        revision, score = node.candidate, node.evaluation.score
        history = revision.history
        if revision.edit is not None:
            history = history.renumbered(revision.edit.ids)
            history = history.add(designs.with_result(revision.edit, node.evaluation))
        for attempt in self._tried.get(revision.label, ()):
            child = attempt.candidate
            if child is None:
                history = history.add(EditRecord("", "Error", attempt.note, before=score))
            elif child.edit is not None:
                tried = designs.with_result(child.edit, self.evaluations[child.machine])
                history = history.add(replace(tried, ids={}))
        return history


def _verdict(attempt: Attempt[Revision]) -> str:
    """The result of an attempt, as later attempts of the same expansion see it."""
    if attempt.candidate is None:
        return attempt.note
    return f"{attempt.note}\n(accepted: make a different change)"


def _feedback(node: Node[Revision]) -> str:
    summary: SimulationSummary = node.evaluation.details
    return summary.feedback
