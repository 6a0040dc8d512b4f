"""Counts of what went wrong in runs, by one stated rule per kind of failure.

The caller tells which machines have a block that faces the wrong way, and which designs do not
follow their rationale: the one takes geometry, the other the recorded calls.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass, field
from typing import Literal

from agentflow.runs import Event
from agentflow.runs.events import AttemptEvent, EvaluationEvent, RunEvent

Level = Literal["format", "planning", "construction"]
Unit = Literal["reply", "machine"]
STILL = 0.1
"""Metres; a machine does not move if no block gets farther than this."""


@dataclass(frozen=True)
class FailureKind:
    """One kind of failure. A refused reply has one kind, a machine may have several.

    An accepted reply can only be of kind `RATIONALE`.
    """

    name: str
    level: Level
    """planning: the wrong thing was to be built; construction: it was built wrongly."""
    unit: Unit
    """What is counted: replies, or simulated machines (each once)."""
    rule: str
    codes: frozenset[str] = frozenset()
    """Codes of the refused replies of this kind."""


UNPARSABLE = FailureKind(
    "unparsable", "format", "reply", "the reply is empty, cut off or not in the required format"
)
MISSING = FailureKind(
    "missing component",
    "planning",
    "reply",
    "a machine or blueprint has too few or too many of a required block",
    frozenset({"required_count", "required_missing"}),
)
PLAN = FailureKind(
    "plan not followed",
    "planning",
    "reply",
    "a design changes or drops given blocks, adds none, or uses a type that its part "
    "of the blueprint does not list; or a blueprint contradicts itself",
    frozenset(
        {
            "given_altered",
            "nothing_added",
            "type_outside_structure",
            "undefined_structure",
            "not_in_build_order",
            "repeated_structure",
            "no_structure",
            "bad_structure",
            "bad_types",
            "too_many_types",
            "missing_key",
        }
    ),
)
RATIONALE = FailureKind(
    "rationale not followed",
    "planning",
    "reply",
    "an accepted machine has fewer blocks of a type than its rationale counts by name "
    '("four Small Wheels"); nothing else in the rationale is checked',
)
FORBIDDEN = FailureKind(
    "block not allowed",
    "planning",
    "reply",
    "a block type is unknown or not allowed in the task",
    frozenset({"type_not_allowed", "unknown_type", "two_ended_type"}),
)
MOTIONLESS = FailureKind(
    "no motion",
    "planning",
    "machine",
    f"no block moves more than {STILL} m after power comes on; not counted for "
    "gearing, where cogs turn in place",
)
FACING = FailureKind(
    "wrong facing",
    "construction",
    "machine",
    "the axle of a powered wheel is not along x in a driving task, or a loaded "
    "container does not open upwards",
)
ATTACHMENT = FailureKind(
    "wrong attachment",
    "construction",
    "reply",
    "a block is attached to a parent or face that does not exist, is occupied or "
    "comes later, has an impossible rotation, or is two-ended with one parent",
    frozenset(
        {
            "face_not_found",
            "face_occupied",
            "parent_not_found",
            "parent_not_earlier",
            "no_parent",
            "rotation",
            "two_ended",
        }
    ),
)
OVERLAP = FailureKind(
    "overlap", "construction", "reply", "two blocks overlap", frozenset({"overlap"})
)
EDIT = FailureKind(
    "refused edit",
    "construction",
    "reply",
    "an edit cannot be read or carried out for another reason",
)
BREAKAGE = FailureKind(
    "breakage", "construction", "machine", "a connection broke in the simulation"
)
OTHER = FailureKind(
    "other",
    "construction",
    "reply",
    "anything else, such as the machine's size or the order of its ids",
    frozenset({"size_limit", "id_sequence", "root", "starting_block", "too_many_blocks"}),
)
KINDS = (
    UNPARSABLE,
    MISSING,
    PLAN,
    RATIONALE,
    FORBIDDEN,
    MOTIONLESS,
    FACING,
    ATTACHMENT,
    OVERLAP,
    EDIT,
    BREAKAGE,
    OTHER,
)


@dataclass
class Failures:
    """Counts of failures in one run or several."""

    replies: int = 0
    """Answered calls."""
    refused: int = 0
    machines: int = 0
    """Machines simulated."""
    kinds: Counter[str] = field(default_factory=Counter)
    """Name of a kind -> replies or machines of it."""
    codes: Counter[str] = field(default_factory=Counter)
    """Code of refused replies -> count; `unparsable` where a reply has none."""

    def __add__(self, other: Failures) -> Failures:
        return Failures(
            self.replies + other.replies,
            self.refused + other.refused,
            self.machines + other.machines,
            self.kinds + other.kinds,
            self.codes + other.codes,
        )


def failures(
    events: Iterable[RunEvent | Event],
    misfaced: Callable[[str], bool],
    unkept: Collection[str] = (),
    *,
    in_place: bool = False,
) -> Failures:
    """Count what went wrong in a run.

    Args:
        events: Events of the run.
        misfaced: Whether the machine with a content hash has a block that faces the wrong way.
        unkept: Labels of the accepted replies that do not follow their own rationale.
        in_place: Whether machines are meant to stay where they are in the run's task.
    """
    found = Failures()
    seen: set[str] = set()
    for event in events:
        if isinstance(event, AttemptEvent):
            found.replies += 1
            found.kinds[RATIONALE.name] += event.label in unkept
            if not event.valid:
                found.refused += 1
                found.kinds[kind_of(event).name] += 1
                found.codes[event.code or "unparsable"] += 1
        elif isinstance(event, EvaluationEvent) and event.machine not in seen:
            seen.add(event.machine)
            found.machines += 1
            still = not in_place and event.moved is not None and event.moved <= STILL
            found.kinds[MOTIONLESS.name] += still
            found.kinds[BREAKAGE.name] += bool(event.broken)
            found.kinds[FACING.name] += misfaced(event.machine)
    return found


def kind_of(attempt: AttemptEvent) -> FailureKind:
    """The kind of failure of a refused reply."""
    for kind in KINDS:
        if attempt.code in kind.codes:
            return kind
    if not attempt.parsed:
        return UNPARSABLE
    return EDIT if attempt.role == "refiner" else OTHER
