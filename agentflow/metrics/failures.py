"""Owns what went wrong in runs, counted by one stated rule for each kind of failure (spec 6.3).

Which block of a machine faces the wrong way takes geometry, what a rationale says takes the calls:
both are asked of the caller.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass, field
from typing import Literal

from agentflow.runs import Event

Level = Literal["format", "planning", "construction"]
Unit = Literal["reply", "machine"]
STILL = 0.1
"""Metres; a machine of which no block gets farther than this does not move."""


@dataclass(frozen=True)
class Kind:
    """One kind of failure. A refused reply is of one kind alone, a machine may be of several.

    An accepted reply can be of `RATIONALE` alone.
    """

    name: str
    level: Level
    """planning: what was to be built is wrong; construction: it was put together wrongly."""
    unit: Unit
    """What is counted: replies, or simulated machines, each machine once."""
    rule: str
    codes: frozenset[str] = frozenset()
    """Codes of refused replies that are of this kind."""


UNPARSABLE = Kind(
    "unparsable", "format", "reply", "the reply is empty, cut off, or lacks the demanded format"
)
MISSING = Kind(
    "missing component",
    "planning",
    "reply",
    "a machine or blueprint lacks, or has too many of, a block that the task demands",
    frozenset({"required_count", "required_missing"}),
)
PLAN = Kind(
    "plan not followed",
    "planning",
    "reply",
    "a design changes or drops given blocks, adds none, or uses a type that its part of the "
    "blueprint does not list; a blueprint contradicts itself",
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
RATIONALE = Kind(
    "rationale not followed",
    "planning",
    "reply",
    "an accepted design of a whole machine has fewer blocks of a type than its own rationale "
    'counts by name ("four Small Wheels"); nothing else that a rationale says is judged',
)
FORBIDDEN = Kind(
    "block not allowed",
    "planning",
    "reply",
    "a block type is unknown or not in the task's list",
    frozenset({"type_not_allowed", "unknown_type", "two_ended_type"}),
)
MOTIONLESS = Kind(
    "no motion",
    "planning",
    "machine",
    f"no block gets farther than {STILL} m from where it was when power came on; not counted in "
    "gearing, where cogs turn in place",
)
FACING = Kind(
    "wrong facing",
    "construction",
    "machine",
    "a powered wheel whose axle is not along x where the task is to drive, or a container that "
    "holds something and does not open upwards",
)
ATTACHMENT = Kind(
    "wrong attachment",
    "construction",
    "reply",
    "a block hangs on a face or parent that does not exist, is taken, or comes later, has a "
    "rotation that no attachment gives, or is two-ended with one parent",
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
OVERLAP = Kind(
    "overlap", "construction", "reply", "two blocks of the machine overlap", frozenset({"overlap"})
)
EDIT = Kind(
    "refused edit",
    "construction",
    "reply",
    "a refinement is refused for another reason: a command that cannot be read or carried out",
)
BREAKAGE = Kind("breakage", "construction", "machine", "a connection gave way in the simulation")
OTHER = Kind(
    "other",
    "construction",
    "reply",
    "refused for anything else, such as the size of the machine or the order of its ids",
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
    """How often what went wrong, in one run or several."""

    replies: int = 0
    """Answered calls."""
    refused: int = 0
    machines: int = 0
    """Machines simulated."""
    kinds: Counter[str] = field(default_factory=Counter)
    """Name of a kind -> replies or machines of it."""
    codes: Counter[str] = field(default_factory=Counter)
    """Code of refused replies -> how many; `unparsable` where there is none."""

    def __add__(self, other: Failures) -> Failures:
        return Failures(
            self.replies + other.replies,
            self.refused + other.refused,
            self.machines + other.machines,
            self.kinds + other.kinds,
            self.codes + other.codes,
        )


def failures(
    events: Iterable[Event],
    misfaced: Callable[[str], bool],
    unkept: Collection[str] = (),
    *,
    in_place: bool = False,
) -> Failures:
    """Count what went wrong in a run.

    Args:
        events: of the run, one at a time.
        misfaced: whether the machine of a content hash has a block that faces the wrong way.
        unkept: labels of the accepted replies that do not follow their own rationale.
        in_place: whether machines of the run's task are to stay where they are.
    """
    found = Failures()
    seen: set[str] = set()
    for event in events:
        data = event.data
        if event.kind == "attempt":
            found.replies += 1
            found.kinds[RATIONALE.name] += event.label in unkept
            if not data["valid"]:
                found.refused += 1
                found.kinds[kind_of(event).name] += 1
                found.codes[data["code"] or "unparsable"] += 1
        elif event.kind == "evaluation" and data["machine"] not in seen:
            seen.add(data["machine"])
            found.machines += 1
            moved = None if in_place else data.get("moved")
            found.kinds[BREAKAGE.name] += bool(data["broken"])
            found.kinds[MOTIONLESS.name] += moved is not None and moved <= STILL
            found.kinds[FACING.name] += misfaced(data["machine"])
    return found


def kind_of(event: Event) -> Kind:
    """What a refused reply is counted as."""
    data = event.data
    for kind in KINDS:
        if data["code"] in kind.codes:
            return kind
    if not data["parsed"]:
        return UNPARSABLE
    return EDIT if data["role"] == "refiner" else OTHER
