"""What a run has learnt: the best machines of its trajectories, and what edits did to scores.

Trajectories see of each other what was known at fixed points: in a search over the whole run, when
a round begins; otherwise when every trajectory is about to refine. Between these points nothing
that is shown changes, so that no order of answers does.
"""

import asyncio
import statistics
from collections import Counter
from collections.abc import Callable, Coroutine, Iterable, Sequence
from dataclasses import dataclass
from itertools import islice, zip_longest
from typing import Any, TypeVar

from agentflow.agents.analyst import AnalystInput
from agentflow.agents.context import Elsewhere, OtherMachine
from agentflow.machine.blocks.library import library
from agentflow.machine.brief import Brief
from agentflow.machine.tree import Machine
from agentflow.runs.events import MemoryEvent, RememberedMachine, RememberedMechanism, RunEvent
from agentflow.runs.locations import FEEDBACK, Location
from agentflow.search.node import Evaluation
from agentflow.search.tree import is_better
from agentflow.tools.host import SimulationSummary
from agentflow.workflows.settings import WorkflowSettings

T = TypeVar("T")
MOST_FOUND = 6
"""Most edits that a run tells other runs about."""
MOST_LESSONS = 40
"""Most lessons; prompts have room for fewer."""
UNKNOWN = "unknown"
"""Mechanism of a machine whose simulation shows none."""


@dataclass(frozen=True)
class Lesson:
    """What one edit did."""

    change: str
    """In words that hold for other machines as well: which blocks came and went."""
    before: float
    after: float
    """Scores of the machine before and after the edit."""

    @property
    def gain(self) -> float:
        """Change of the score."""
        return self.after - self.before


@dataclass(frozen=True)
class Known:
    """A machine and what is known of it."""

    machine: Machine
    evaluation: Evaluation

    @property
    def mechanism(self) -> str:
        """Class of its mechanism: what drives, what holds, what releases."""
        summary: SimulationSummary = self.evaluation.details
        return summary.mechanism or UNKNOWN


@dataclass(frozen=True)
class Snapshot:
    """What is shown, until the next fixed point."""

    best: tuple[tuple[int, Known], ...] = ()
    """(trajectory, its best machine), by falling score."""
    lessons: tuple[str, ...] = ()
    """What edits did, one line each, the most telling first."""
    mechanisms: tuple[RememberedMechanism, ...] = ()
    """By falling score."""


class Memory:
    """The memory of one run."""

    def __init__(
        self, brief: Brief, settings: WorkflowSettings, note: Callable[[RunEvent], None]
    ) -> None:
        """Begin empty; `note` records what is shown from now on."""
        self.shown = Snapshot()
        self.edits: list[Lesson] = []
        self._brief, self._settings, self._note = brief, settings, note
        self.revealed = 0
        """How often what is shown has changed."""
        self._best: dict[int, Known] = {}
        self._scores: dict[str, list[float]] = {}
        self._members: set[int] = set()
        self._waiting: set[int] = set()
        self._released = asyncio.Event()
        self._avoiding: dict[int, tuple[str, ...]] = {}
        self._analysed: tuple[tuple[str, ...], tuple[str, ...]] = ((), ())
        """Lessons that an analyst has been given, and what it wrote; nothing if it failed."""

    @property
    def is_shared(self) -> bool:
        """Whether trajectories see anything of each other."""
        return self._settings.inspirations > 0 or self._settings.lessons

    def learn(self, trajectory: int, found: Known, origin: Known | None = None) -> None:
        """Take in a simulated machine, and the one that it was made from."""
        evaluation = found.evaluation
        best = self._best.get(trajectory)
        if best is None or is_better(evaluation, best.evaluation):
            self._best[trajectory] = found
        after = evaluation.reward
        if after is not None and evaluation.valid:
            self._scores.setdefault(found.mechanism, []).append(after)
        before = None if origin is None else origin.evaluation.reward
        if origin is not None and before is not None and after is not None:
            change = change_text(origin.machine, found.machine)
            if change:
                self.edits.append(Lesson(change, before, after))

    def reveal(self) -> None:
        """Show what is known now, if anything is ever shown; a fixed point."""
        if not self.is_shared and not self._settings.another_mechanism:
            return
        classes = [
            RememberedMechanism(name, len(scores), max(scores))
            for name, scores in self._scores.items()
        ]
        classes.sort(key=lambda item: (-item.best, item.mechanism))
        shown = Snapshot(self._ranked, lessons_of(self.edits), tuple(classes))
        if shown != self.shown:
            self.shown = shown
            self.revealed += 1
            best = tuple(
                RememberedMachine(number, it.machine.digest, it.evaluation.score, it.mechanism)
                for number, it in shown.best
            )
            at = Location(FEEDBACK, round=self.revealed)
            self._note(MemoryEvent(at, best, shown.lessons, shown.mechanisms))

    @property
    def to_analyse(self) -> AnalystInput | None:
        """What an analyst is to be asked now; None for nothing."""
        given, written = self._analysed
        lessons = self.shown.lessons
        if not self._settings.asks_analyst or lessons == given:
            return None
        return AnalystInput(self._brief, lessons=lessons, mechanisms=self._told, earlier=written)

    def analysed(self, written: tuple[str, ...]) -> None:
        """Show what an analyst has made of the lessons, until they change."""
        self._analysed = (self.shown.lessons, written)

    @property
    def _told(self) -> tuple[str, ...]:
        """The mechanisms shown, a line each."""
        return tuple(
            f"{it.mechanism}: {it.count} machine{'s' * (it.count > 1)}, best score {it.best:.2f}"
            for it in self.shown.mechanisms
            if it.mechanism != UNKNOWN
        )

    @property
    def _ranked(self) -> tuple[tuple[int, Known], ...]:
        """The best machine of each trajectory that has a score, by falling score."""
        best = [item for item in self._best.items() if item[1].evaluation.reward is not None]
        return tuple(sorted(best, key=lambda item: (-(item[1].evaluation.reward or 0.0), item[0])))

    @property
    def findings(self) -> tuple[str, ...]:
        """What other runs at the task should know: the best machine, and the most telling edits."""
        if not self._ranked:
            return ()
        _, best = self._ranked[0]
        counts = Counter(library()[step.type].name for step in best.machine.steps[1:])
        blocks = ", ".join(f"{count} {name}" for name, count in counts.most_common())
        told = f"A machine scored {best.evaluation.score:.2f}: {best.mechanism}; {blocks}"
        lessons = self._analysed[1] or lessons_of(self.edits)
        return (told, *lessons[:MOST_FOUND])

    def avoid(self, trajectory: int) -> tuple[str, ...]:
        """Ask the first design of a trajectory for another mechanism than those shown now."""
        self._avoiding[trajectory] = self._told
        return self._told

    def for_trajectory(self, trajectory: int) -> Elsewhere:
        """What a role of a trajectory is shown."""
        others = [known for number, known in self.shown.best if number != trajectory]
        machines = tuple(
            OtherMachine(known.machine, known.evaluation.score, known.mechanism)
            for known in others[: self._settings.inspirations]
        )
        written = self._analysed[1]
        lessons = written or self.shown.lessons if self._settings.lessons else ()
        avoided = self._avoiding.get(trajectory, ())
        book = self._settings.known_lessons
        return Elsewhere(machines, lessons, bool(written), book, avoided)

    def in_step(
        self, jobs: Iterable[tuple[int, Coroutine[Any, Any, T]]]
    ) -> list[Coroutine[Any, Any, T]]:
        """Let the jobs of trajectories wait for each other before they refine, if they see each
        other; all must run at the same time."""
        given = list(jobs)
        if self.is_shared:
            self._members.update(trajectory for trajectory, _ in given)
        return [self._member(*item) for item in given]

    async def _member(self, trajectory: int, job: Coroutine[Any, Any, T]) -> T:
        try:
            return await job
        finally:
            self._members.discard(trajectory)
            self._release()

    async def step(self, trajectory: int) -> None:
        """Wait until every other trajectory is about to refine as well, or has ended."""
        if trajectory not in self._members:
            return
        self._waiting.add(trajectory)
        released = self._released
        self._release()
        await released.wait()

    def _release(self) -> None:
        if self._waiting and self._waiting >= self._members:
            self._waiting = set()
            self.reveal()
            self._released.set()
            self._released = asyncio.Event()


def change_text(before: Machine, after: Machine) -> str:
    """What an edit changed, in words for other machines: blocks by type, not by id; "" if nothing
    is different."""
    if before == after:
        return ""
    counts = Counter(step.type for step in after)
    counts.subtract(Counter(step.type for step in before))
    parts = [
        f"{count:+d} {library()[kind].name}" for kind, count in sorted(counts.items()) if count
    ]
    if parts:
        return ", ".join(parts)
    if before.steps == after.steps:
        return "other controls"
    moved = sum(old != new for old, new in zip(before, after, strict=True))
    return f"{moved} block{'s' * (moved > 1)} moved"


def lessons_of(edits: Sequence[Lesson]) -> tuple[str, ...]:
    """What edits did to the score, a line for each kind of change, gains and losses in turns; those
    that did most come first."""
    groups: dict[str, list[Lesson]] = {}
    for lesson in edits:
        groups.setdefault(lesson.change, []).append(lesson)
    ranked = sorted(groups.items(), key=lambda item: (-abs(_gain(item[1])), item[0]))
    gains = [_line(*item) for item in ranked if _gain(item[1]) > 0]
    losses = [_line(*item) for item in ranked if _gain(item[1]) < 0]
    turns = (line for pair in zip_longest(gains, losses) for line in pair if line)
    return tuple(islice(turns, MOST_LESSONS))


def _gain(lessons: Sequence[Lesson]) -> float:
    return statistics.fmean(lesson.gain for lesson in lessons)


def _line(change: str, lessons: Sequence[Lesson]) -> str:
    best = max(lesson.after for lesson in lessons)
    many = f" on average of {len(lessons)}" if len(lessons) > 1 else ""
    return f"{change}: {_gain(lessons):+.2f}{many}, to {best:.2f}{' at best' * bool(many)}"
