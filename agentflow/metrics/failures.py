"""Counts the failures in runs, by the rules of `failure_kinds`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass, field

from agentflow.metrics import failure_kinds
from agentflow.runs import Event
from agentflow.runs.events import AttemptEvent, EvaluationEvent, RunEvent, ToolEvent

MAKING = frozenset({"check", "edit"})
"""Tools that make machines."""
TOO_LATE = "stage_ended"
"""Code of calls that came after the end of their stage, which say nothing about what they sent."""


@dataclass
class Failures:
    """Counts of failures in one run or several.

    `replies` are answered calls; of an agent, its calls of tools that make machines. `kinds` counts
    replies or machines by the name of the kind, `codes` refused replies by their code, which is
    `unparsable` without one.
    """

    replies: int = 0
    refused: int = 0
    machines: int = 0
    kinds: Counter[str] = field(default_factory=Counter)
    codes: Counter[str] = field(default_factory=Counter)

    def add(self, kind: failure_kinds.FailureKind | None, code: str) -> None:
        """Count a reply, refused if it has a kind of failure."""
        self.replies += 1
        if kind is not None:
            self.refused += 1
            self.kinds[kind.name] += 1
            self.codes[code or "unparsable"] += 1

    def __add__(self, other: Failures) -> Failures:
        pairs = zip(vars(self).values(), vars(other).values(), strict=True)
        return Failures(*(mine + theirs for mine, theirs in pairs))


def failures(
    events: Iterable[RunEvent | Event],
    faces_wrong_way: Callable[[str], bool],
    replies_of: Callable[[str], str],
    unfollowed: Collection[str] = (),
    *,
    in_place: bool = False,
) -> Failures:
    """Count what went wrong in a run.

    Args:
        events: Events of the run.
        faces_wrong_way: Whether a block of the machine with this content hash does.
        replies_of: Role -> what it replies with: answers, edits, or calls of tools.
        unfollowed: Labels of the accepted replies that do not follow their own rationale.
        in_place: Whether machines should stay where they are in the run's task.
    """
    found = Failures()
    seen: set[str] = set()
    for event in events:
        if isinstance(event, AttemptEvent):
            found.kinds[failure_kinds.RATIONALE.name] += event.label in unfollowed
            what = replies_of(event.role)
            if what != "calls" or not event.valid:  # calls have events of their own
                found.add(None if event.valid else kind_of(event, what), event.code)
        elif isinstance(event, ToolEvent) and event.tool in MAKING and event.code != TOO_LATE:
            unnamed = failure_kinds.EDIT if event.tool == "edit" else failure_kinds.UNPARSABLE
            found.add(_kind_with(event.code) or unnamed if event.refused else None, event.code)
        elif isinstance(event, EvaluationEvent) and event.machine not in seen:
            seen.add(event.machine)
            found.machines += 1
            still = not in_place and event.moved is not None and event.moved <= failure_kinds.STILL
            found.kinds[failure_kinds.MOTIONLESS.name] += still
            found.kinds[failure_kinds.BREAKAGE.name] += bool(event.broken)
            found.kinds[failure_kinds.FACING.name] += faces_wrong_way(event.machine)
    return found


def kind_of(attempt: AttemptEvent, what: str) -> failure_kinds.FailureKind:
    """The kind of failure of a refused reply, which was to be answers, edits or calls."""
    unnamed = failure_kinds.EDIT if what == "edits" else failure_kinds.OTHER
    return _kind_with(attempt.code) or (unnamed if attempt.parsed else failure_kinds.UNPARSABLE)


def _kind_with(code: str) -> failure_kinds.FailureKind | None:
    """The kind of failure that a code names."""
    return next((kind for kind in failure_kinds.KINDS if code in kind.codes), None)
